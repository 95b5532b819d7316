//! What could break: the page that lists every key says less, or more, than the readers read.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use sim::{Quantity, Scene, Simulated};
use spanned_toml::{Document, Problem, Source};

/// A part of the page about one table of a file.
struct Section {
    /// `[simulated]`, `[[emitter]]`: the line of the example below which its keys stand.
    header: String,
    examples: Vec<String>,
    keys: BTreeSet<String>,
}

/// No reader knows it, nor a key that resembles it.
const UNKNOWN: &str = "zzzzzzzzzz";

fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/simulator.md")
}

/// What stands in backticks.
fn quoted(text: &str) -> Vec<String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

fn sections() -> Vec<Section> {
    let text = fs::read_to_string(page()).unwrap();
    let parts = text.split("\n### ").skip(1).map(|part| part.split("\n## ").next().unwrap());
    parts
        .map(|part| {
            let (heading, body) = part.split_once('\n').unwrap();
            let rows = body.lines().filter(|line| line.starts_with("| `"));
            let cells = rows.map(|row| row.trim_start_matches('|').split(" | ").next().unwrap());
            Section {
                header: quoted(heading).remove(0),
                examples: body
                    .split("```toml\n")
                    .skip(1)
                    .map(|block| block.split("```").next().unwrap().to_owned())
                    .collect(),
                keys: cells.flat_map(quoted).collect(),
            }
        })
        .collect()
}

/// Reads a table `[simulated]`, or a scene.
fn read(text: &str, quantity: Quantity) -> Result<(), Problem> {
    let document = Document::parse(Source::new("example.toml", text)).expect("it is TOML");
    if text.contains("[simulated") {
        return Simulated::read(document.root().required_table("simulated")?).map(|_| ());
    }
    let examples = page().with_file_name("../examples/luminaire");
    let load = move |name: &str| {
        if Path::new(name).extension().is_some_and(|ext| ext == "pgm") {
            return Ok(b"P2\n2 2\n255\n9 200 30 255\n".to_vec());
        }
        fs::read(examples.join(name)).map_err(|error| error.to_string())
    };
    Scene::read(&document, quantity, &load).map(|_| ())
}

/// The keys that the reader of the table knows, as its refusal of another lists them.
fn known(example: &str, header: &str, quantity: Quantity) -> BTreeSet<String> {
    let line = format!("{header}\n");
    let (before, after) = example.split_once(&line).expect("the example has the section's table");
    let spoilt = format!("{before}{line}{UNKNOWN} = 1\n{after}");
    let refusal = read(&spoilt, quantity).expect_err("an unknown key is refused").to_string();
    assert!(refusal.contains(UNKNOWN), "{refusal}\nin {spoilt}");
    let list = refusal.split("one of: ").nth(1).expect("it lists the keys").lines().next().unwrap();
    let name = |key: &str| key.trim_matches(|c: char| !c.is_alphanumeric()).to_owned();
    list.split(", ").map(name).collect()
}

/// The same scene for a photometric detector.
fn in_lumens(example: &str) -> String {
    let with = example.replace("radiance_w_per_m2_sr", "luminance_cd_per_m2");
    with.replace("irradiance_w_per_m2", "illuminance_lx")
}

#[test]
fn every_key_is_documented_and_every_documented_key_is_read() {
    let sections = sections();
    assert!(sections.len() >= 15, "{} sections", sections.len());
    for Section { header, examples, keys } in sections {
        assert!(!examples.is_empty(), "{header} has no example");
        let mut read = BTreeSet::new();
        for example in &examples {
            read.extend(known(example, &header, Quantity::Radiance));
            // A photometric file is in one unit only.
            if !example.contains(".ies") {
                read.extend(known(&in_lumens(example), &header, Quantity::Luminance));
            }
        }
        assert_eq!(keys, read, "left: {header} as documented; right: as read");
    }
}

#[test]
fn every_example_of_the_page_is_read() {
    for Section { header, examples, .. } in sections() {
        for example in examples {
            if let Err(problem) = read(&example, Quantity::Radiance) {
                panic!("{header}: {problem}\n{example}");
            }
        }
    }
}
