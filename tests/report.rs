//! A run's report as people open it: one well-formed page that needs nothing else, whose numbers
//! are those of fit.json, and which is drawn again from the journal byte for byte.

mod bench;

use std::collections::BTreeSet;

use bench::Bench;
use roxmltree::{Document, Node, ParsingOptions};
use serde_json::Value;

const PICTURES: [&str; 12] = [
    "polar",
    "hemisphere",
    "plane",
    "budget",
    "budget-intensity",
    "budget-peak",
    "accuracy",
    "residuals-theta",
    "residuals-time",
    "signal",
    "reference",
    "dark",
];

fn parsed(page: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(page, options).unwrap_or_else(|error| panic!("{error}\n{page}"))
}

fn text_of(node: Node<'_, '_>) -> String {
    node.descendants().filter_map(|n| n.is_text().then(|| n.text()).flatten()).collect()
}

/// The rows of the table under a heading.
fn rows(page: &Document<'_>, heading: &str) -> Vec<Vec<String>> {
    let is_it = |n: &Node<'_, '_>| {
        n.has_tag_name(("http://www.w3.org/1999/xhtml", "h2")) && text_of(*n) == heading
    };
    let title = page.descendants().find(is_it).unwrap_or_else(|| panic!("no {heading}"));
    let section = title.parent().unwrap();
    let rows = section.descendants().filter(|n| n.tag_name().name() == "tr").skip(1);
    let cells = |row: Node<'_, '_>| {
        row.children().filter(Node::is_element).map(text_of).collect::<Vec<_>>()
    };
    rows.map(cells).collect()
}

fn figures(page: &Document<'_>) -> Vec<String> {
    let figures = page.descendants().filter(|n| n.tag_name().name() == "figure");
    figures.map(|n| n.attribute("id").unwrap().to_owned()).collect()
}

/// How many elements of a figure have this class.
fn marked(page: &Document<'_>, figure: &str, class: &str) -> usize {
    let figure = page.descendants().find(|n| n.attribute("id") == Some(figure)).unwrap();
    figure.descendants().filter(|n| n.attribute("class") == Some(class)).count()
}

/// `157.8 ± 1.1 W/m²` and `(1.234 ± 0.012)e-7 W` as value, u, and half a unit of the last digit.
fn estimate(text: &str) -> (f64, f64, f64) {
    let (numbers, exponent) = match text.strip_prefix('(') {
        Some(rest) => {
            let (numbers, rest) = rest.split_once(")e").unwrap();
            (numbers, rest.split(' ').next().unwrap().parse::<i32>().unwrap())
        }
        None => (text, 0),
    };
    let mut words = numbers.split(' ');
    let (value, u) = (words.next().unwrap(), words.nth(1).unwrap());
    let decimals = value.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let scale = 10_f64.powi(exponent);
    let half = 0.5 * 10_f64.powi(-i32::try_from(decimals).unwrap());
    let number = |text: &str| text.parse::<f64>().unwrap() * scale;
    (number(value), number(u), half * scale)
}

fn agrees(cell: &str, fit: &Value) {
    let (value, u, half) = estimate(cell);
    let number = |key: &str| fit[key].as_f64().unwrap_or_else(|| panic!("no {key} in {fit}"));
    let margin = half * (1.0 + 1e-9);
    assert!((value - number("value")).abs() <= margin, "{cell} beside {fit}");
    assert!((u - number("u")).abs() <= margin, "{cell} beside {fit}");
}

#[test]
fn a_report_is_whole_self_contained_and_drawn_again_to_the_same_bytes() {
    let bench = Bench::small();
    let run = bench.gonio(&["run", "plan.toml", "--out", "out", "--json"]).well().json();
    assert_eq!(run["report"], "out/report.html");
    let page = bench.text("out/report.html");
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    let document = parsed(&page);
    assert_eq!(figures(&document), PICTURES);
    check_self_contained(&document);
    assert!(page.contains("Simulated: these readings were computed"), "nobody may overlook it");
    let targets = format!("{0} of {0} measured", run["targets_planned"]);
    let unseen = "Not looked for: features narrower than ";
    for part in ["small", "simulated gantry", "seed 1", targets.as_str(), unseen] {
        assert!(page.contains(part), "{part}");
    }
    check_results(&bench, &document);

    std::fs::remove_file(bench.path("out/report.html")).unwrap();
    let said = bench.gonio(&["report", "out", "--pictures", "drawn", "--json"]).well().json();
    assert_eq!(said["simulated"], true);
    assert_eq!(said["pictures"], serde_json::json!(PICTURES));
    assert_eq!(bench.text("out/report.html"), page);
    assert_eq!(bench.gonio(&["report", "out", "-o", "-"]).well().out, page);
    for picture in PICTURES {
        let svg = bench.text(&format!("drawn/{picture}.svg"));
        assert_eq!(parsed(&svg).root_element().tag_name().name(), "svg");
        assert!(svg.contains("<style>") && !svg.contains("NaN"), "{picture}");
    }
}

/// Nothing is fetched, nothing runs, and every name that is referred to is there once.
fn check_self_contained(document: &Document<'_>) {
    let mut names = BTreeSet::new();
    for node in document.descendants().filter(Node::is_element) {
        let tag = node.tag_name().name();
        assert!(!["script", "link", "img", "image", "iframe", "object"].contains(&tag), "{tag}");
        if let Some(id) = node.attribute("id") {
            assert!(names.insert(id.to_owned()), "{id} twice");
        }
    }
    for node in document.descendants().filter(Node::is_element) {
        for attribute in node.attributes() {
            let (name, value) = (attribute.name(), attribute.value());
            assert!(
                !["src", "href", "srcset"].contains(&name) && !name.starts_with("on"),
                "{name}"
            );
            assert!(!value.contains("http"), "{name}={value}");
            if let Some((_, rest)) = value.split_once("url(#") {
                let id = rest.split(')').next().unwrap();
                assert!(names.contains(id), "{id} is nowhere");
            }
        }
        if node.tag_name().name() == "style" {
            let style = text_of(node);
            assert!(!style.contains("url(") && !style.contains("@import"), "{style}");
        }
    }
}

fn check_results(bench: &Bench, document: &Document<'_>) {
    let fit = bench.json("out/fit.json");
    let rows = rows(document, "Results");
    let names: Vec<&str> = rows.iter().map(|row| row[0].trim()).collect();
    let row = |name: &str| {
        let place = names.iter().position(|n| n.starts_with(name));
        &rows[place.unwrap_or_else(|| panic!("no {name} in {names:?}"))]
    };
    for (name, key) in [
        ("radiant exitance", "exitance_w_per_m2"),
        ("within 80", "exitance_within_region_w_per_m2"),
        ("radiant flux", "flux_w"),
        ("peak radiance", "peak_radiance"),
    ] {
        let row = row(name);
        agrees(&row[1], &fit[key]);
        // On a simulated rig the truth, and the error in u.
        let truth: f64 = row[5].split(' ').next().unwrap().parse().unwrap();
        let (_, _, half) = estimate(&row[1]);
        let known = fit["truth"][key]["value"].as_f64().unwrap();
        assert!((truth - known).abs() <= half * (1.0 + 1e-9), "{row:?}");
        let error = (fit[key]["value"].as_f64().unwrap() - known) / fit[key]["u"].as_f64().unwrap();
        let shown: f64 = row[7].parse().unwrap();
        assert!((shown - error).abs() <= 0.005 + 1e-9, "{row:?}: {error}");
    }
    assert!(row("radiant intensity on axis")[1].ends_with("W/sr"));
    let percent = |text: &str| text.strip_suffix(" %").unwrap().parse::<f64>().unwrap();
    let exitance = row("radiant exitance");
    assert!(percent(&exitance[3]) < 0.2 * percent(&exitance[2]), "the scale is most of it");
    let fraction = fit["exitance_w_per_m2"]["measured_fraction"].as_f64().unwrap();
    assert!((percent(&exitance[4]) / 100.0 - fraction).abs() < 1e-3);
}

#[test]
fn what_a_list_leaves_out_is_hatched_and_what_it_measures_is_not() {
    let poses = |keep: &dyn Fn(u32, u32) -> bool| {
        let mut lines = vec!["x_mm,y_mm,theta_deg,phi_deg".to_owned()];
        for theta in (0..=80).step_by(10) {
            let phi = (0..360).step_by(15).filter(|phi| keep(theta, *phi));
            lines.extend(phi.map(|phi| format!("0,0,{theta},{phi}")));
        }
        lines.join("\n")
    };
    let bench = Bench::small();
    let plan = bench.text("plan.toml");
    let (before, rest) = plan.split_once("[schedule]").unwrap();
    let (_, after) = rest.split_once("[dwell]").unwrap();
    let schedule = "[schedule]\nkind = \"list\"\nfile = \"poses.csv\"\n\n[dwell]";
    let plan = format!("{before}{schedule}{after}");
    let plan = plan.replace("position_degree = 1", "position_degree = 0");
    let bench = bench.having("plan.toml", plan).having("poses.csv", poses(&|_, _| true));
    bench.gonio(&["run", "plan.toml", "--out", "whole"]).well();
    let wedge = |theta: u32, phi: u32| theta < 20 || !(30..120).contains(&phi);
    let bench = bench.having("poses.csv", poses(&wedge));
    bench.gonio(&["run", "plan.toml", "--out", "wedge"]).well();

    let (whole, cut) = (bench.text("whole/report.html"), bench.text("wedge/report.html"));
    let (whole, cut) = (parsed(&whole), parsed(&cut));
    assert_eq!(marked(&whole, "hemisphere", "gap"), 0);
    assert_eq!(marked(&cut, "hemisphere", "gap"), 4, "in each of its panels");
    for page in [&whole, &cut] {
        assert_eq!(marked(page, "hemisphere", "gap beyond"), 4, "beyond 80 degrees");
    }
}

#[test]
fn what_files_say_is_shown_as_they_say_it_and_does_nothing() {
    let name = "<b onclick='x'>&\\\"rig";
    let bench = Bench::small().with("rig.toml", "simulated gantry", name);
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let page = bench.text("out/report.html");
    let document = parsed(&page);
    check_self_contained(&document);
    // Each picture's title, and nothing else.
    let bold = document.descendants().filter(|n| n.tag_name().name() == "b").count();
    assert_eq!(bold, PICTURES.len());
    let cells = document.descendants().filter(|n| n.tag_name().name() == "td").map(text_of);
    assert!(cells.into_iter().any(|cell| cell == "<b onclick='x'>&\"rig (simulated)"));
}

#[test]
fn photometric_and_relative_reports_carry_their_own_names() {
    let photometric = |bench: Bench| {
        bench
            .with("rig.toml", "quantity = \"radiance\"", "quantity = \"luminance\"")
            .with("rig.toml", "responsivity_a_per_w = 0.2", "responsivity_a_per_lm = 0.2")
            .with("scene.toml", "radiance_w_per_m2_sr", "luminance_cd_per_m2")
    };
    let bench = photometric(Bench::small());
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let page = bench.text("out/report.html");
    for name in ["luminous exitance", "luminous flux", "luminous intensity", "lm/m²", "cd/m²"] {
        assert!(page.contains(name), "{name}");
    }
    // Only effects say what the simulator's own keys are called.
    let without_effects = page.split("<h2>Effects").next().unwrap();
    for name in ["radian", "W/", " W<"] {
        assert!(!without_effects.contains(name), "{name}");
    }

    let bench = Bench::small()
        .with("rig.toml", "quantity = \"radiance\"", "quantity = \"relative\"")
        .with("rig.toml", "responsivity_a_per_w = 0.2\nu_responsivity_relative = 0.005\n", "")
        .with("scene.toml", "radiance_w_per_m2_sr = 50", "radiance_w_per_m2_sr = 10");
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let page = bench.text("out/report.html");
    for name in ["relative exitance", "relative flux", "relative intensity", "relative radiance L"]
    {
        assert!(page.contains(name), "{name}");
    }
    let without_effects = page.split("<h2>Effects").next().unwrap();
    for name in ["radiant", "W/", " W<", "lm", "cd/"] {
        assert!(!without_effects.contains(name), "{name}");
    }
}

#[test]
fn a_run_without_a_fit_has_a_report_that_says_why() {
    let bench = Bench::small().with("plan.toml", "angular_degree = 2", "angular_degree = 30");
    let said = bench.gonio(&["run", "plan.toml", "--out", "out"]);
    assert_eq!(said.code, Some(1), "{said}");
    let page = bench.text("out/report.html");
    assert!(page.contains("There is no fit: "), "{page}");
    assert_eq!(figures(&parsed(&page)), ["signal", "reference", "dark"]);
}

#[test]
fn what_is_no_run_has_no_report() {
    let bench = Bench::small();
    bench.gonio(&["report", "nowhere"]).refused(&["nowhere"]);
    bench.gonio(&["report"]).refused(&["<DIR>"]);
    bench.gonio(&["run", "plan.toml", "--out", "out"]).well();
    let page = bench.text("out/report.html");
    let said = bench.gonio(&["report", "out", "-o", "no/folder/report.html"]);
    assert_eq!(said.code, Some(1), "{said}");
    said.says(&["no/folder/report.html"]);
    assert_eq!(bench.text("out/report.html"), page, "left as it was");
}
