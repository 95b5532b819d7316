//! What was foretold beside what was found: as a section of a document, as a picture, and as raw numbers.

use benches::scatter::{Group, Scatter};
use benches::{Section, Table};

use super::{Compared, Quantity};

/// Relative, of time after homing.
const TIME_AIM: f64 = 0.02;
/// Factor, either way, of an uncertainty.
const U_AIM: f64 = 1.3;
/// A u below this part of a quantity is none that a rig has, and what it is a factor of says nothing.
const U_MIN: f64 = 1e-5;

/// Of the servos' arm, whoever foretells.
const OF_SCATTER: &str = "some runs' fits take scatter beyond what is stated for structure that their basis \
                          can't follow, and state hundreds of times what they are off; others do not";

/// Why an example's runs are not what its plan foretells, where they are not.
const OF_PLANS: [(&str, &str); 5] = [
    (
        "batwing",
        "the ring is smoother than other features of its width, and the fits do better than foretold",
    ),
    (
        "luminaire",
        "a measured lamp has more structure than one feature at a time: its fits are farther off than foretold, \
         state more than they are off, and for the exitance what such structure could do beyond the region, \
         where nobody looked",
    ),
    (
        "penumbra",
        "one straight edge is kinder to the basis than stripes of its width in any place and direction, and its \
         fits are less off than foretold; but two angles 60° apart are read, of which the plan declares nothing, \
         and its fits state what may lie between them",
    ),
    ("servo-arm", OF_SCATTER),
    (
        "sun-window",
        "no feature that a plan can declare is like what the pane does to sunlight, towards grazing above all; \
         the plan foretells too little of all that its fits find, and a rehearsal all of it",
    ),
];
/// The same of rehearsals.
const OF_REHEARSALS: [(&str, &str); 4] = [
    (
        "adaptive",
        "readings decide what is measured, and when it is enough: runs differ in length and in what they \
         know, and the mean over a few of them is not that over others",
    ),
    ("batwing", "what its fits state for directions beyond the region differs from seed to seed"),
    ("luminaire", "what its fits state for directions beyond the region differs from seed to seed"),
    ("servo-arm", OF_SCATTER),
];

pub(super) fn section(rows: &[Compared], seeds: u64) -> Section {
    let mut section = Section::new("predictions", "Do predictions of time and accuracy hold?");
    section.say(&format!(
        "{seeds} runs an example; time after homing, and relative standard uncertainties in per cent, RMS over the \
         runs. \"Plan\" is foretold by `gonio plan` from the plan and the rig alone; \"rehearsal\" by \
         `gonio plan --rehearse {seeds}` with other seeds, before the example's own scene: what a person foretells \
         who knows the source. Once with the scale as it is, once with it known exactly (responsivity, lengths and \
         gain without u), where it does not hide all the rest. First what the runs came to over what was foretold: \
         of u that of the exitance, the exitance within the region or the radiance which is farthest from 1. Where \
         readings decide what is measured, a plan alone says neither."
    ));
    section.show(&summary(rows));
    section
        .say("Where both u are below 0.001 % they count as the same, and are not in the figure.");
    let drawn = || rows.iter().filter(|row| !row.is_scale_known);
    for (how, of) in [("plan", by_plan as fn(&Compared) -> _), ("rehearsal", by_rehearsal)] {
        let missed: Vec<&str> =
            drawn().filter(|row| of(row).is_some_and(is_late)).map(|row| row.example).collect();
        let aim = format!("time within 2 % of that foretold by the {how}");
        conclude(&mut section, &aim, &missed.join(", "));
    }
    for (is_known, scale) in [(false, "the scale as it is"), (true, "the scale known")] {
        for (how, of) in [("plan", expected as Foretold), ("rehearsal", rehearsed)] {
            let rows = rows.iter().filter(|row| row.is_scale_known == is_known);
            let pairs = rows.flat_map(|row| row.quantities.iter().map(move |q| (row, q)));
            let missed = pairs.filter(|(_, q)| of(q).is_some_and(|u| !within(u, q.stated)));
            let missed: Vec<String> =
                missed.map(|(row, q)| format!("{} of {}", q.name, row.example)).collect();
            let aim = format!("u within a factor 1.3 of that foretold by the {how}, {scale}");
            conclude(&mut section, &aim, &missed.join(", "));
        }
    }
    for (how, of, reasons) in
        [("plan", expected as Foretold, &OF_PLANS[..]), ("rehearsal", rehearsed, &OF_REHEARSALS)]
    {
        let is_missed = |example: &str| {
            let mine = rows.iter().filter(|row| row.example == example);
            mine.flat_map(|row| &row.quantities)
                .any(|q| of(q).is_some_and(|u| !within(u, q.stated)))
        };
        let reasons = reasons.iter().filter(|(example, _)| is_missed(example));
        let said: Vec<String> =
            reasons.map(|(example, why)| format!("- {example}: {why}.")).collect();
        if !said.is_empty() {
            section.say(&format!("Why, of what the {how} foretells:\n\n{}", said.join("\n")));
        }
    }
    section.say(
        "All of it in numbers. \"From\" and \"to\" are the plan's for features that the basis follows better \
         and worse; \"error\" is how far the fits are off the simulator's truth.",
    );
    section.show(&times(rows));
    section.show(&uncertainties(rows));
    section.keep(raw(rows));
    section
}

fn conclude(section: &mut Section, aim: &str, missed: &str) {
    section.aim(aim, missed.is_empty());
    if !missed.is_empty() {
        section.say(&format!("Beyond it: {missed}."));
    }
}

/// What a quantity's u is foretold to be, if it is.
type Foretold = fn(&Quantity) -> Option<f64>;

fn expected(quantity: &Quantity) -> Option<f64> {
    quantity.expected
}

// An option for the sake of the other one.
#[expect(clippy::unnecessary_wraps)]
fn rehearsed(quantity: &Quantity) -> Option<f64> {
    Some(quantity.rehearsed)
}

fn by_plan(row: &Compared) -> Option<f64> {
    Some(row.measured_s / row.foretold_s?)
}

#[expect(clippy::unnecessary_wraps)]
fn by_rehearsal(row: &Compared) -> Option<f64> {
    Some(row.measured_s / row.rehearsed_s)
}

fn is_late(ratio: f64) -> bool {
    (ratio - 1.0).abs() > TIME_AIM
}

/// A line an example: what came of it over what was foretold.
fn summary(rows: &[Compared]) -> Table {
    let mut table = Table::new(&[
        "example",
        "time / plan",
        "/ rehearsal",
        "u / plan",
        "/ rehearsal",
        "scale known: u / plan",
        "/ rehearsal",
    ]);
    for row in rows.iter().filter(|row| !row.is_scale_known) {
        let time = |ratio: Option<f64>| {
            ratio.map_or_else(String::new, |ratio| marked(format!("{ratio:.4}"), is_late(ratio)))
        };
        let mut cells = vec![row.example.to_owned(), time(by_plan(row)), time(by_rehearsal(row))];
        for is_known in [false, true] {
            let same = |r: &&Compared| r.example == row.example && r.is_scale_known == is_known;
            for of in [expected as Foretold, rehearsed] {
                cells.push(rows.iter().find(same).map_or_else(String::new, |row| worst(row, of)));
            }
        }
        table.row(cells);
    }
    table
}

/// The ratio that is farthest from 1, and whose it is.
fn worst(row: &Compared, of: Foretold) -> String {
    let foretold = row.quantities.iter().filter_map(|q| Some((q, of(q)?)));
    let seen: Vec<(&Quantity, f64)> = foretold.collect();
    let counting = seen.iter().filter(|(q, u)| !is_nothing(*u, q.stated));
    let ratios = counting.map(|(q, u)| (q.name, q.stated / u));
    match ratios.max_by(|a, b| a.1.ln().abs().total_cmp(&b.1.ln().abs())) {
        Some((name, ratio)) if ratio.ln().abs() > U_AIM.ln() => {
            format!("**{ratio:.2}** {name}")
        }
        Some((_, ratio)) => format!("{ratio:.2}"),
        None if seen.is_empty() => String::new(),
        None => "the same".to_owned(),
    }
}

fn marked(text: String, is_missed: bool) -> String {
    if is_missed { format!("**{text}**") } else { text }
}

fn times(rows: &[Compared]) -> Table {
    let mut times =
        Table::new(&["example", "by the plan, s", "by the rehearsal, s", "measured, s"]);
    for row in rows.iter().filter(|row| !row.is_scale_known) {
        let seconds = |s: f64| format!("{s:.1}");
        times.row([
            row.example.to_owned(),
            row.foretold_s.map_or_else(String::new, seconds),
            seconds(row.rehearsed_s),
            seconds(row.measured_s),
        ]);
    }
    times
}

fn uncertainties(rows: &[Compared]) -> Table {
    let mut table = Table::new(&[
        "example, scale",
        "quantity",
        "plan, %",
        "from",
        "to",
        "rehearsal, %",
        "stated, %",
        "stated / plan",
        "stated / rehearsal",
        "error, %",
    ]);
    for row in rows {
        for quantity in &row.quantities {
            table.row([row.name()].into_iter().chain(quantity.cells()));
        }
    }
    table
}

impl Compared {
    fn name(&self) -> String {
        let scale = if self.is_scale_known { "known" } else { "drawn" };
        format!("{}, {scale}", self.example)
    }
}

impl Quantity {
    fn cells(&self) -> [String; 9] {
        let or_none = |value: Option<f64>| value.map_or_else(String::new, percent);
        let ratio = |foretold: f64| format!("{:.2}", self.stated / foretold);
        [
            self.name.to_owned(),
            or_none(self.expected),
            or_none(self.range.map(|range| range.0)),
            or_none(self.range.map(|range| range.1)),
            percent(self.rehearsed),
            percent(self.stated),
            self.expected.map_or_else(String::new, ratio),
            ratio(self.rehearsed),
            percent(self.error),
        ]
    }
}

fn within(foretold: f64, stated: f64) -> bool {
    is_nothing(foretold, stated) || (1.0 / U_AIM..=U_AIM).contains(&(stated / foretold))
}

fn is_nothing(foretold: f64, stated: f64) -> bool {
    foretold < U_MIN && stated < U_MIN
}

fn percent(relative: f64) -> String {
    format!("{:.2e}", 100.0 * relative)
}

pub(super) fn figure(rows: &[Compared]) -> Scatter {
    let of = |name: &str, is_known: bool, foretold: Foretold| {
        let rows = rows.iter().filter(|row| row.is_scale_known == is_known);
        let all = rows.flat_map(|row| &row.quantities);
        let point = |q: &Quantity| {
            let u = foretold(q)?;
            (!is_nothing(u, q.stated)).then_some((u, q.stated / u))
        };
        let points = all.filter_map(point);
        Group { name: name.to_owned(), points: points.collect() }
    };
    Scatter {
        title: "Stated over foretold uncertainty, all examples".to_owned(),
        x_label: "foretold u, relative".to_owned(),
        y_label: "stated / foretold".to_owned(),
        levels: vec![1.0 / U_AIM, U_AIM],
        groups: vec![
            of("by the plan", false, expected),
            of("by the plan, scale known", true, expected),
            of("by a rehearsal", false, rehearsed),
            of("by a rehearsal, scale known", true, rehearsed),
        ],
    }
}

fn raw(rows: &[Compared]) -> Table {
    let mut raw = Table::new(&[
        "example",
        "scale_known",
        "quantity",
        "expected",
        "rehearsed",
        "measured",
        "error",
    ]);
    for row in rows {
        let known = row.is_scale_known.to_string();
        let own = [row.example.to_owned(), known.clone()];
        let number = |s: f64| format!("{s:e}");
        let foretold = row.foretold_s.map_or_else(String::new, number);
        let time = ["time_after_homing_s".to_owned(), foretold];
        let [rehearsed, measured] = [row.rehearsed_s, row.measured_s].map(number);
        raw.row(own.into_iter().chain(time).chain([rehearsed, measured, String::new()]));
        for quantity in &row.quantities {
            let Quantity { name, expected, rehearsed, stated, error, .. } = quantity;
            let expected = expected.map_or_else(String::new, |u| format!("{u:e}"));
            let own = [row.example.to_owned(), known.clone(), format!("u {name}"), expected];
            raw.row(own.into_iter().chain([rehearsed, stated, error].map(|u| format!("{u:e}"))));
        }
    }
    raw
}
