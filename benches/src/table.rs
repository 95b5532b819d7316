//! A small table, for a terminal and for Markdown alike.

use std::fmt;

/// Rows of text under a head; numbers stand to the right.
#[derive(Debug, Clone, Default)]
pub struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// With a head and no rows.
    pub fn new(head: &[&str]) -> Self {
        Self { head: head.iter().map(|&word| word.to_owned()).collect(), rows: Vec::new() }
    }

    /// Adds a row; what it lacks stays empty.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(self.head.len(), String::new());
        self.rows.push(cells);
    }

    /// As comma-separated values; cells hold no commas or quotes of their own.
    pub fn csv(&self) -> String {
        let lines = std::iter::once(&self.head).chain(&self.rows);
        lines.map(|cells| cells.join(",") + "\n").collect()
    }

    fn widths(&self) -> Vec<usize> {
        let lines = || std::iter::once(&self.head).chain(&self.rows);
        let width = |column: usize| lines().map(|cells| cells[column].chars().count()).max();
        (0..self.head.len()).map(|column| width(column).unwrap_or(0)).collect()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widths = self.widths();
        let line = |f: &mut fmt::Formatter<'_>, cells: &[String]| -> fmt::Result {
            for (i, (cell, &width)) in cells.iter().zip(&widths).enumerate() {
                if i == 0 {
                    write!(f, "| {cell:width$} |")?;
                } else {
                    write!(f, " {cell:>width$} |")?;
                }
            }
            writeln!(f)
        };
        line(f, &self.head)?;
        for (i, &width) in widths.iter().enumerate() {
            let rule = "-".repeat(width);
            if i == 0 {
                write!(f, "| {rule} |")?;
            } else {
                write!(f, " {}: |", &rule[1.min(width)..])?;
            }
        }
        writeln!(f)?;
        self.rows.iter().try_for_each(|cells| line(f, cells))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_and_numbers_stand_to_the_right() {
        let mut table = Table::new(&["what", "s"]);
        table.row(["a longer one", "1.5"]);
        table.row(["b", "12"]);
        let expected = "\
| what         |   s |
| ------------ | --: |
| a longer one | 1.5 |
| b            |  12 |
";
        assert_eq!(table.to_string(), expected);
        assert_eq!(table.csv(), "what,s\na longer one,1.5\nb,12\n");
    }
}
