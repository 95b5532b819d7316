//! An uncertainty budget as bars, the largest part on top.

use super::svg::{Anchor, Picture, Svg, px};
use super::ticks::{round_up, significant};

const LEFT: f64 = 190.0;
const LENGTH: f64 = 430.0;
const ROW: f64 = 24.0;
/// Parts that have a bar of their own; the smaller ones share one.
const BARS_MAX: usize = 14;
/// As do those that are smaller than this part of the whole.
const SEEN: f64 = 0.002;

/// What is drawn.
pub struct Budget<'a> {
    /// The picture's name: `budget`.
    pub name: &'static str,
    /// What is uncertain: `exitance`.
    pub quantity: &'a str,
    /// Its value; the parts are shown relative to it.
    pub value: f64,
    /// The parts of its standard uncertainty by source; their squares add to the whole's.
    pub parts: &'a [(String, f64)],
}

impl Budget<'_> {
    /// The bars; `None` where there is no value to relate them to, or no part.
    pub fn picture(&self) -> Option<Picture> {
        let scale = 100.0 / self.value.abs();
        let mut parts: Vec<(&str, f64)> = self
            .parts
            .iter()
            .map(|(name, u)| (name.as_str(), u * scale))
            .filter(|(_, u)| *u > 0.0 && u.is_finite())
            .collect();
        if parts.is_empty() {
            return None;
        }
        parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(b.0)));
        let sum = |parts: &[(&str, f64)]| libm::sqrt(parts.iter().map(|(_, u)| u * u).sum());
        let whole: f64 = sum(&parts);
        let seen = parts.iter().filter(|(_, u)| *u >= SEEN * whole).count();
        // One that would share a bar with nobody keeps its own.
        let seen = if seen + 1 == parts.len() { parts.len() } else { seen };
        let rest = parts.split_off(seen.min(BARS_MAX));
        let others = format!("{} others", rest.len());
        if !rest.is_empty() {
            parts.push((&others, sum(&rest)));
        }
        let all: Vec<(&str, f64)> = [("combined", whole)].into_iter().chain(parts).collect();
        let height = ROW * all.len() as f64 + 10.0;
        let title = format!("Uncertainty of the {} by source", self.quantity);
        let mut svg = Svg::new(LEFT + LENGTH + 120.0, height, &title);
        let end = round_up(whole);
        for (i, (name, u)) in all.iter().enumerate() {
            let y = 5.0 + ROW * i as f64;
            let colour = if i == 0 { "--ink" } else { "--a" };
            let [x, top, width, thick] = [LEFT, y + 4.0, LENGTH * u / end, ROW - 8.0].map(px);
            svg.raw(&format!(
                "<rect class=\"bar\" fill=\"var({colour})\" x=\"{x}\" y=\"{top}\" \
                 width=\"{width}\" height=\"{thick}\"/>"
            ));
            svg.label("", Anchor::End, (LEFT - 8.0, y + 0.5 * ROW), &shortened(name));
            let text = format!("{} %", significant(*u, 3));
            let end = LEFT + LENGTH * u / end + 6.0;
            svg.label("", Anchor::Start, (end, y + 0.5 * ROW), &text);
        }
        let caption = format!(
            "Standard uncertainty (k = 1) relative to the {}. Squares of the parts add to the \
             square of the whole; “independent” is what falls as more is measured.",
            self.quantity
        );
        Some(Picture { name: self.name, title, caption, svg: svg.finish() })
    }
}

/// A name that fits beside its bar.
fn shortened(name: &str) -> String {
    const LETTERS: usize = 26;
    if name.chars().count() <= LETTERS {
        return name.to_owned();
    }
    name.chars().take(LETTERS - 1).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_part_is_on_top_and_small_ones_share_a_bar() {
        let part = |i: u32| (format!("part {i}"), f64::from(i));
        let parts: Vec<(String, f64)> = (0..20).map(part).collect();
        let budget = Budget { name: "budget", quantity: "exitance", value: 100.0, parts: &parts };
        let svg = budget.picture().unwrap().svg;
        assert_eq!(svg.matches("class=\"bar\"").count(), BARS_MAX + 2);
        // √(1² + … + 19²), and √(1² + … + 5²).
        assert!(svg.contains(">49.7 %<") && svg.contains(">7.42 %<"), "{svg}");
        assert!(svg.find("part 19") < svg.find("part 18") && svg.contains("5 others"));
    }

    #[test]
    fn nothing_to_relate_to_is_no_picture() {
        let parts = [("independent".to_owned(), 1.0)];
        assert_eq!(
            Budget { name: "budget", quantity: "exitance", value: 0.0, parts: &parts }.picture(),
            None
        );
        assert_eq!(
            Budget { name: "budget", quantity: "exitance", value: 1.0, parts: &[] }.picture(),
            None
        );
    }
}
