//! What outlasts a program, as plain numbers one after the other: lists with their length before them. It
//! knows neither files nor what the numbers mean; whoever takes them up checks them, since they come from
//! outside.

/// Finite numbers that are yet to be taken up.
pub(crate) struct Numbers<'n>(&'n [f64]);

impl<'n> Numbers<'n> {
    pub(crate) fn of(numbers: &'n [f64]) -> Self {
        Self(numbers)
    }

    /// Whether all are taken up.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The next one.
    pub(crate) fn number(&mut self) -> Option<f64> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first).filter(|number| number.is_finite())
    }

    /// The next one, a count of at most so many.
    pub(crate) fn count(&mut self, most: usize) -> Option<usize> {
        let found = whole(self.number()?)?;
        usize::try_from(found).ok().filter(|count| *count <= most)
    }

    /// The next ones, so many.
    pub(crate) fn some(&mut self, count: usize) -> Option<Vec<f64>> {
        let (first, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        first.iter().all(|number| number.is_finite()).then(|| first.to_vec())
    }

    /// A list of at most so many entries of N numbers each.
    pub(crate) fn all<const N: usize, T, C: FromIterator<T>>(
        &mut self,
        most: usize,
        of: impl Fn([f64; N]) -> Option<T>,
    ) -> Option<C> {
        let numbers = self.count(most)?.checked_mul(N)?;
        let numbers = self.some(numbers)?;
        numbers.as_chunks::<N>().0.iter().map(|entry| of(*entry)).collect()
    }
}

/// A list of entries of N numbers each.
pub(crate) fn put_all<const N: usize>(
    out: &mut Vec<f64>,
    entries: impl ExactSizeIterator<Item = [f64; N]>,
) {
    out.push(entries.len() as f64);
    out.extend(entries.flatten());
}

/// A whole number that every f64 of its size can hold.
pub(crate) fn whole(number: f64) -> Option<i64> {
    let is_whole = number.fract().abs() <= 0.0 && number.abs() <= WHOLE_MOST;
    #[allow(clippy::cast_possible_truncation)] // checked
    is_whole.then_some(number as i64)
}

/// 2^53.
const WHOLE_MOST: f64 = 9_007_199_254_740_992.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, PartialEq)]
    struct Pairs(Vec<(i64, f64)>);

    impl Pairs {
        fn put(&self, out: &mut Vec<f64>) {
            put_all(out, self.0.iter().map(|&(n, x)| [n as f64, x]));
        }

        fn stored(numbers: &mut Numbers<'_>) -> Option<Self> {
            numbers.all(3, |[n, x]| Some((whole(n)?, x))).map(Self)
        }
    }

    #[test]
    fn what_is_put_is_taken_up_and_nothing_else() {
        let pairs = Pairs(vec![(-3, 0.5), (1 << 53, -0.0)]);
        let of = |numbers: &[f64]| {
            let mut numbers = Numbers::of(numbers);
            Pairs::stored(&mut numbers).filter(|_| numbers.is_empty())
        };
        let mut numbers = Vec::new();
        pairs.put(&mut numbers);
        assert_eq!(of(&numbers), Some(pairs));
        assert_eq!(of(&[0.0]), Some(Pairs(Vec::new())));
        let long = [numbers.as_slice(), &[1.0]].concat();
        for wrong in [&numbers[..4], &long, &[], &[1.0, 0.5, 1.0], &[1.0, 1.0, f64::NAN]] {
            assert_eq!(of(wrong), None, "{wrong:?}");
        }
        for count in [-1.0, 4.0, 1e300, f64::INFINITY] {
            assert_eq!(of(&[count, 1.0, 1.0]), None, "{count}");
        }
    }
}
