//! Lists in a table: of points, and of texts.

use std::ops::RangeInclusive;

use super::Table;
use crate::value::{Kind, Value};
use crate::{Bounds, Problem};

impl<'d> Table<'d> {
    /// A list of points, each a list of numbers inside `bounds`: as many as the ranges allow.
    pub fn points(
        &self,
        key: &str,
        bounds: Bounds,
        count: RangeInclusive<usize>,
        dimensions: RangeInclusive<usize>,
    ) -> Result<Option<Vec<Vec<f64>>>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(None) };
        let each = format!("{} to {} numbers, each {bounds}", dimensions.start(), dimensions.end());
        let expected = format!("a list of {} to {} lists of {each}", count.start(), count.end());
        let list = match &value.kind {
            Kind::Array(list) if count.contains(&list.len()) => list,
            _ => return Err(self.unexpected(key, value, &expected)),
        };
        let point = |item: &Value| match &item.kind {
            Kind::Array(numbers) if dimensions.contains(&numbers.len()) => {
                numbers.iter().map(|number| self.read_number(key, number, bounds)).collect()
            }
            _ => Err(self.unexpected(key, item, &format!("a list of {each}"))),
        };
        list.iter().map(point).collect::<Result<_, _>>().map(Some)
    }

    /// A list of texts, none of them empty.
    pub fn texts(&self, key: &str) -> Result<Option<Vec<&'d str>>, Problem> {
        let Some(value) = self.look_up(key) else { return Ok(None) };
        let expected = "a list of texts that are not empty, in quotes";
        let Kind::Array(list) = &value.kind else {
            return Err(self.unexpected(key, value, expected));
        };
        let texts = list.iter().map(|item| match &item.kind {
            Kind::Text(text) if !text.trim().is_empty() => Ok(text.as_str()),
            _ => Err(self.unexpected(key, item, expected)),
        });
        texts.collect::<Result<_, _>>().map(Some)
    }
}
