//! The report of a run as one page of HTML that needs nothing but itself: no network, no script.
//! It is handed words, tables and pictures in the order in which they stand.

use std::io::{self, Write};

use super::svg::{Picture, STYLE, escape};

const PAGE_STYLE: &str = "\
body{margin:0 auto;max-width:1000px;padding:1.5rem 1rem 4rem;background:var(--paper);color:var(--ink);\
font:15px/1.45 system-ui,'DejaVu Sans',Verdana,Arial,sans-serif}\
h1{font-size:1.6rem;margin:.2em 0}h2{font-size:1.15rem;margin:2em 0 .5em}\
.banner{border:2px solid var(--b);padding:.5em .8em;margin:1em 0;font-weight:600}\
table{border-collapse:collapse;margin:.5em 0;font-variant-numeric:tabular-nums}\
td,th{text-align:left;vertical-align:top;padding:.2em .9em .2em 0;border-bottom:1px solid var(--grid)}\
th{font-weight:600}td+td{white-space:nowrap}.facts td,td.text{white-space:normal}tbody td:first-child{min-width:9em}.facts th{white-space:nowrap;width:11em}.wide{overflow-x:auto}\
figure{margin:1.5em 0;break-inside:avoid}figcaption{color:var(--soft);font-size:.9em;max-width:60em}\
svg.picture{display:block;max-width:100%;height:auto}\
ul{padding-left:1.2em}p.note{color:var(--soft)}\
@media print{body{max-width:none;padding:0}h2{break-after:avoid}tr{break-inside:avoid}\
.wide{overflow:visible}}";

/// A table: the names of its columns, and its rows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Table {
    /// One a column.
    pub columns: Vec<String>,
    /// Cells, as many a row as there are columns.
    pub rows: Vec<Vec<String>>,
}

/// A part of the page under a heading of its own. What is empty is not shown.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// Paragraphs.
    pub paragraphs: Vec<String>,
    /// A table.
    pub table: Table,
    /// Pictures.
    pub pictures: Vec<Picture>,
    /// A list.
    pub items: Vec<String>,
}

/// The page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// What the run is called.
    pub title: String,
    /// What nobody may overlook: that it was simulated, that it is not complete.
    pub banners: Vec<String>,
    /// The run's facts: name and text.
    pub facts: Vec<(String, String)>,
    /// All else.
    pub sections: Vec<Section>,
}

impl Report {
    /// Every picture, in the page's order.
    pub fn pictures(&self) -> impl Iterator<Item = &Picture> {
        self.sections.iter().flat_map(|section| section.pictures.iter())
    }

    /// Writes the page: HTML that is well-formed XML too.
    pub fn write(&self, mut out: impl Write) -> io::Result<()> {
        let title = escape(&self.title);
        writeln!(out, "<!DOCTYPE html>")?;
        writeln!(out, "<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\"><head>")?;
        writeln!(out, "<meta charset=\"utf-8\"/>")?;
        writeln!(out, "<meta name=\"viewport\" content=\"width=device-width\"/>")?;
        writeln!(out, "<title>{title}</title>")?;
        writeln!(out, "<style>{STYLE}{PAGE_STYLE}</style></head><body>")?;
        writeln!(out, "<h1>{title}</h1>")?;
        for banner in &self.banners {
            writeln!(out, "<p class=\"banner\">{}</p>", escape(banner))?;
        }
        writeln!(out, "<table class=\"facts\"><tbody>")?;
        for (name, text) in &self.facts {
            writeln!(out, "<tr><th>{}</th><td>{}</td></tr>", escape(name), escape(text))?;
        }
        writeln!(out, "</tbody></table>")?;
        for section in &self.sections {
            section.write(&mut out)?;
        }
        writeln!(out, "</body></html>")
    }
}

impl Section {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "<section><h2>{}</h2>", escape(&self.title))?;
        for paragraph in &self.paragraphs {
            writeln!(out, "<p>{}</p>", escape(paragraph))?;
        }
        self.table.write(out)?;
        for picture in &self.pictures {
            let (caption, title) = (escape(&picture.caption), escape(&picture.title));
            writeln!(out, "<figure id=\"{}\">{}", picture.name, picture.svg)?;
            writeln!(out, "<figcaption><b>{title}.</b> {caption}</figcaption></figure>")?;
        }
        if !self.items.is_empty() {
            writeln!(out, "<ul>")?;
            for item in &self.items {
                writeln!(out, "<li>{}</li>", escape(item))?;
            }
            writeln!(out, "</ul>")?;
        }
        writeln!(out, "</section>")
    }
}

impl Table {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        if self.rows.is_empty() {
            return Ok(());
        }
        writeln!(out, "<div class=\"wide\"><table><thead><tr>")?;
        for column in &self.columns {
            write!(out, "<th>{}</th>", escape(column))?;
        }
        writeln!(out, "</tr></thead><tbody>")?;
        for row in &self.rows {
            write!(out, "<tr>")?;
            for cell in row {
                // Sentences are broken into lines, numbers and their units are not.
                let class = if cell.chars().count() > 40 { " class=\"text\"" } else { "" };
                write!(out, "<td{class}>{}</td>", escape(cell))?;
            }
            writeln!(out, "</tr>")?;
        }
        writeln!(out, "</tbody></table></div>")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_handed_in_is_escaped() {
        let nasty = "<img src=x onerror=\"alert('&')\">";
        let picture = Picture {
            name: "map",
            title: nasty.to_owned(),
            caption: nasty.to_owned(),
            svg: "<svg></svg>".to_owned(),
        };
        let section = Section {
            title: nasty.to_owned(),
            paragraphs: vec![nasty.to_owned()],
            table: Table { columns: vec![nasty.to_owned()], rows: vec![vec![nasty.to_owned()]] },
            pictures: vec![picture],
            items: vec![nasty.to_owned()],
        };
        let report = Report {
            title: nasty.to_owned(),
            banners: vec![nasty.to_owned()],
            facts: vec![(nasty.to_owned(), nasty.to_owned())],
            sections: vec![section],
        };
        let mut page = Vec::new();
        report.write(&mut page).unwrap();
        let page = String::from_utf8(page).unwrap();
        assert!(!page.contains("<img") && !page.contains("('"), "{page}");
        assert_eq!(page.matches("&lt;img src=x onerror=&quot;").count(), 12);
    }
}
