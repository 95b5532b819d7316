//! A Markdown document that holds one section a measurement, each between a pair of marks, so that
//! measuring again replaces it.

/// The document with this section instead of the one of its name, or after the others.
#[must_use]
pub fn with_section(document: &str, name: &str, text: &str) -> String {
    let (begin, end) = (format!("<!-- begin {name} -->\n"), format!("<!-- end {name} -->\n"));
    let section = format!("{begin}{text}{end}");
    let place = document.find(&begin).zip(document.find(&end));
    match place {
        Some((from, to)) if from < to => {
            format!("{}{section}{}", &document[..from], &document[to + end.len()..])
        }
        _ => format!("{document}\n{section}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_added_once_and_then_replaced_in_its_place() {
        let one = with_section("# Head\n", "a", "first\n");
        let two = with_section(&one, "b", "other\n");
        let three = with_section(&two, "a", "second\n");
        let expected = "# Head\n\n<!-- begin a -->\nsecond\n<!-- end a -->\n\n\
                        <!-- begin b -->\nother\n<!-- end b -->\n";
        assert_eq!(three, expected);
    }
}
