//! The plans and rigs in examples/ read, and their predictions are sensible.

use std::path::Path;

use spanned_toml::Document;

use super::Plan;
use crate::rig::Rig;

#[test]
fn every_example_reads_and_lays_out_on_its_own_rig() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&examples).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.join("plan.toml").exists() {
            continue;
        }
        let plan = Document::read(&folder.join("plan.toml")).and_then(Plan::read);
        let plan = plan.unwrap_or_else(|e| panic!("{e}"));
        let rig_file = plan.rig.as_deref().unwrap();
        let rig = Document::read(&folder.join(rig_file)).and_then(Rig::read);
        let rig = rig.unwrap_or_else(|e| panic!("{e}"));
        assert!(rig.is_simulated(), "{}", folder.display());
        let list =
            plan.list_file().map(|file| spanned_toml::Source::read(&folder.join(file)).unwrap());
        let sequence = plan.lay_out(&rig, list.as_ref()).unwrap_or_else(|e| panic!("{e}"));
        let prediction = sequence.prediction;
        let per_reading_s = prediction.total_s() / f64::from(prediction.readings);
        // In flight a window takes its own time.
        assert!((0.02..2.0).contains(&per_reading_s), "{}: {prediction:?}", folder.display());
        names.push(plan.name.unwrap());
    }
    names.sort();
    for name in ["lambertian", "led-lobe", "luminaire"] {
        assert!(names.iter().any(|known| known == name), "no example {name}");
    }
}
