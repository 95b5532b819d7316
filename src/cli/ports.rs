//! `gonio ports`: which serial ports there are; with --probe, who answers on one.

use std::process::ExitCode;
use std::time::Duration;

use firmware_protocol::Identity;
use serde_json::json;

use super::acquire::Pace;
use super::args::PortsArgs;
use super::failure::{Failure, Outcome};
use super::output::{note, say, say_json};
use super::session::draw_session;
use super::text::table;
use crate::device::{self, Found, Greeting, SerialSettings, ServoFound, list_ports, open_serial};

/// A board that was reset by opening its port listens after two or three seconds.
const PATIENCE: Duration = Duration::from_secs(4);

/// Lists the ports and opens none, or asks one who is there.
pub(crate) fn ports(args: &PortsArgs) -> Outcome {
    if let Some(port) = &args.probe {
        return probe(port, args.baud, args.json);
    }
    let ports = list_ports().map_err(|error| Failure::start(format!("serial ports: {error}")))?;
    if args.json {
        let list: Vec<_> = ports
            .iter()
            .map(|port| json!({"path": port.path, "description": port.description}))
            .collect();
        say_json(&json!({ "ports": list }))?;
    } else if ports.is_empty() {
        say("no serial port; a pseudo-terminal of `gonio sim --pty` is opened by its path\n")?;
    } else {
        let rows: Vec<_> = ports.into_iter().map(|p| vec![p.path, p.description]).collect();
        say(&table(&rows))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn probe(port: &str, baud: u32, is_json: bool) -> Outcome {
    note(&format!("opening {port} at {baud} baud and asking who is there; nothing will move"));
    let runtime = Pace::Real.runtime()?;
    let settings = SerialSettings {
        port: port.to_owned(),
        baud,
        reset_on_open: false,
        boot_wait: Duration::ZERO,
    };
    let found = runtime.block_on(async {
        let link = open_serial(&settings).await.map_err(Failure::start)?;
        device::probe(link, draw_session(), baud, PATIENCE).await.map_err(Failure::start)
    })?;
    if is_json {
        let mut document = match &found {
            Found::Controller(identity) => as_json(identity),
            Found::Grbl(greeting) => grbl_as_json(greeting),
            Found::Instrument(name) => json!({ "kind": "instrument", "identity": name }),
            Found::Newport { unit, range } => {
                json!({ "kind": "newport-1830c", "unit": unit, "range": range })
            }
            Found::Servos(servos) => servos_as_json(servos),
        };
        document["port"] = json!(port);
        document["baud"] = json!(baud);
        say_json(&document)?;
    } else {
        say(&match &found {
            Found::Controller(identity) => as_text(identity),
            Found::Grbl(greeting) => grbl_as_text(greeting),
            Found::Instrument(name) => format!("  an instrument that calls itself {name}\n"),
            Found::Newport { unit, range } => format!(
                "  a Newport 1830-C, as it answers to U? and R?: unit {unit}, range {range}\n"
            ),
            Found::Servos(servos) => servos_as_text(servos),
        })?;
    }
    Ok(ExitCode::SUCCESS)
}

fn as_json(identity: &Identity) -> serde_json::Value {
    let axes: Vec<_> = identity
        .axes
        .iter()
        .map(|axis| {
            json!({
                "low_counts": axis.low, "high_counts": axis.high,
                "speed_counts_per_s": axis.speed,
                "acceleration_counts_per_s2": axis.acceleration,
            })
        })
        .collect();
    let (major, minor) = identity.protocol;
    json!({
        "kind": "gonio", "protocol": format!("{major}.{minor}"),
        "boot_id": identity.boot_id, "axes": axes, "gains": identity.gains,
        "adc_bits": identity.adc_bits, "adc_rate_hz": identity.adc_rate_hz,
        "queue_depth": identity.queue_depth, "lease_ms": identity.lease_ms,
    })
}

fn servos_as_json(servos: &[ServoFound]) -> serde_json::Value {
    let list: Vec<_> = servos
        .iter()
        .map(|servo| {
            json!({
                "id": servo.id.number(), "model": servo.model, "name": servo.model_name(),
                "firmware": servo.firmware, "hardware_error": servo.alert,
            })
        })
        .collect();
    json!({ "kind": "dynamixel", "servos": list })
}

fn servos_as_text(servos: &[ServoFound]) -> String {
    let lines: Vec<String> = servos.iter().map(|servo| format!("  {servo}\n")).collect();
    format!("  a bus of Dynamixel servos, protocol 2.0\n{}", lines.concat())
}

fn grbl_as_json(greeting: &Greeting) -> serde_json::Value {
    let Greeting { version, state, axes, position } = greeting;
    json!({
        "kind": "grbl", "version": version, "state": state, "axes": axes, "position": position,
        "watchdog": null,
    })
}

fn grbl_as_text(greeting: &Greeting) -> String {
    let Greeting { version, state, axes, position } = greeting;
    let version = version.as_ref().map_or_else(
        || "of a version that it was not asked for, since it moves".to_owned(),
        |version| format!("of version {version}"),
    );
    let position: Vec<String> = position.iter().map(f64::to_string).collect();
    format!(
        "  a board with grbl {version}: {state}, {axes} axes at {}; no device watchdog\n",
        position.join(", ")
    )
}

fn as_text(identity: &Identity) -> String {
    let mut rows =
        vec![["channel", "low", "high", "speed", "acceleration"].map(str::to_owned).to_vec()];
    for (channel, axis) in identity.axes.iter().enumerate() {
        rows.push(vec![
            channel.to_string(),
            axis.low.to_string(),
            axis.high.to_string(),
            format!("{} counts/s", axis.speed),
            format!("{} counts/s²", axis.acceleration),
        ]);
    }
    let (major, minor) = identity.protocol;
    format!(
        "  a controller of gonio's own protocol {major}.{minor}, boot {:08x}\n{}  {} gain ranges, \
         {}-bit converter at {} Hz\n",
        identity.boot_id,
        table(&rows),
        identity.gains,
        identity.adc_bits,
        identity.adc_rate_hz
    )
}
