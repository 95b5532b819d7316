//! A run's report: its results as plain numbers, words and functions, handed to the room that draws.
//! And `gonio report`, which renders it again from the journal.

mod course;
mod derived;
mod facts;
mod fields;
mod flagged;
mod quantities;
mod words;

use std::path::Path;
use std::process::ExitCode;

use serde_json::json;

use super::adapting;
use super::args::ReportArgs;
use super::failure::{Failure, Outcome};
use super::output::{say, say_json, write_out};
use super::results::{Results, open_run};
use super::setup::Setup;
use super::summary::unseen_in_words;
use super::text::{row, table};
use crate::export::write_atomically;
use crate::journal::{Event, Header, JournalError, Reader, Session};
use crate::report::{Report, Section};
use crate::rig::Reading;

/// The file in a run's folder.
pub(crate) const REPORT: &str = "report.html";

/// What a run's journal says of it.
#[derive(Debug)]
pub(crate) struct RunRecord<'a> {
    pub(crate) header: Header,
    /// Has its readings, whatever their number.
    pub(crate) reader: &'a Reader,
    /// Of a run in blocks those beside its targets'.
    pub(crate) readings: Vec<Reading>,
    pub(crate) sessions: Vec<Session>,
    pub(crate) events: Vec<Event>,
}

impl<'a> RunRecord<'a> {
    /// With the readings that came with the run's results.
    pub(crate) fn of(reader: &'a Reader, readings: Vec<Reading>) -> Result<Self, JournalError> {
        let (header, sessions, events) = (reader.header()?, reader.sessions()?, reader.events()?);
        Ok(Self { header, reader, readings, sessions, events })
    }
}

/// Renders a run's report again.
pub(crate) fn report(args: &ReportArgs) -> Outcome {
    let (setup, _, reader) = open_run(&args.dir)?;
    let (results, readings) = Results::of_run(&setup, &reader, false)?;
    let record = RunRecord::of(&reader, readings)?;
    let report = of(&setup, &results, &record);
    let output = args.output.clone().unwrap_or_else(|| args.dir.join(REPORT));
    if output == Path::new("-") {
        write_out(|out| report.write(out))?;
        return Ok(ExitCode::SUCCESS);
    }
    write_atomically(&output, |out| report.write(out)).map_err(Failure::midway)?;
    if let Some(folder) = &args.pictures {
        write_pictures(folder, &report)?;
    }
    let names: Vec<&str> = report.pictures().map(|picture| picture.name).collect();
    if args.json {
        say_json(&json!({
            "run": record.header.plan_name,
            "simulated": record.header.simulated,
            "report": output.display().to_string(),
            "pictures": names,
        }))?;
    } else {
        let rows =
            [row("pictures", names.join(", ")), row("written to", output.display().to_string())];
        say(&table(&rows))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Each picture in a file of its own.
fn write_pictures(folder: &Path, report: &Report) -> Result<(), Failure> {
    let cannot = |error| {
        Failure::midway(format!("{}: the folder cannot be made: {error}", folder.display()))
    };
    std::fs::create_dir_all(folder).map_err(cannot)?;
    for picture in report.pictures() {
        let path = folder.join(picture.name).with_extension("svg");
        write_atomically(&path, |out| out.write_all(picture.document().as_bytes()))
            .map_err(Failure::midway)?;
    }
    Ok(())
}

/// The report of a run.
pub(crate) fn of(setup: &Setup, results: &Results, record: &RunRecord<'_>) -> Report {
    let length_s = facts::rig_time_s(results, record);
    let mut sections = Vec::new();
    match &results.fitted {
        Ok(fitted) => {
            sections.push(Section {
                title: "Results".to_owned(),
                paragraphs: vec![format!("Not looked for: {}.", unseen_in_words(&fitted.resolves))],
                table: quantities::table(setup, results, fitted),
                items: facts::notes(setup, results),
                ..Section::default()
            });
            sections.extend(derived::section(setup, results));
            sections.push(fields::section(setup, results, fitted));
            sections.extend(fields::budget(setup, fitted, &results.independent));
            sections.extend(course::accuracy(setup, results));
            sections.extend(course::residuals(setup, results, length_s));
        }
        Err(error) => sections.push(Section {
            title: "Results".to_owned(),
            paragraphs: vec![format!("There is no fit: {error}")],
            items: facts::notes(setup, results),
            ..Section::default()
        }),
    }
    sections.extend(adapting::section(setup));
    sections.extend(course::signal(setup, results, &record.readings, length_s));
    sections.extend(flagged::section(setup, results));
    sections.extend(flagged::effects(setup));
    Report {
        title: format!("{}: {}", record.header.plan_name, record.header.rig_name),
        banners: facts::banners(setup, results, record),
        facts: facts::facts(setup, results, record),
        sections,
    }
}
