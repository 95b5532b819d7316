//! One rig, driven by three kinds of devices: the example's file, rewritten. It knows no results.

use std::path::Path;

use benches::{Unmeasured, copy_example, edit};

/// A kind of rig, and how it is broken: device, kind of fault, and who then stops the axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rig {
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    /// Of what moves its axes; empty for gonio's own.
    pub(crate) driver: &'static str,
    axes: Axes,
    pub(crate) faults: &'static [(&'static str, &'static str, &'static str)],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axes {
    Grbl,
    Native,
    Servos,
}

pub(crate) const METER: &str = "keithley-6485";
const HOLD: &str = "the host, by a feed hold";
const GOALS: &str = "the host, by new goals";

/// gonio's own first: the others are compared with it.
pub(crate) const RIGS: [Rig; 3] = [
    Rig {
        name: "own",
        title: "gonio's own controller",
        driver: "",
        axes: Axes::Native,
        faults: &[],
    },
    Rig {
        name: "grbl",
        title: "grbl, picoammeter",
        driver: "grbl",
        axes: Axes::Grbl,
        faults: &[
            ("grbl", "unplugged", "nobody can: it ends its move"),
            ("grbl", "mute", "itself: a move is over before the host is sure"),
            ("grbl", "alarm", "itself, at once"),
            (METER, "unplugged", HOLD),
        ],
    },
    Rig {
        name: "servos",
        title: "Dynamixel, picoammeter",
        driver: "dynamixel",
        axes: Axes::Servos,
        faults: &[
            ("dynamixel", "unplugged", "the servos' watchdog, 500 ms"),
            ("dynamixel", "mute", "the servos' watchdog, once the host is sure"),
            ("dynamixel", "overload", GOALS),
            (METER, "unplugged", GOALS),
        ],
    },
];

const GRBL: &str = "driver = \"grbl\"
letters = { theta = \"X\", phi = \"Y\", x = \"Z\", y = \"A\" }
zero_deg = { theta = -100, phi = -180 }
zero_mm = { x = -50, y = -50 }
shutter = \"flood\"

";

/// Arm and turntable at half their speed, which is a whole multiple of a servo's unit too, and
/// wide steps.
pub(crate) fn slow_down(folder: &Path) -> Result<(), Unmeasured> {
    edit(&folder.join("rig.toml"), |line| {
        let is_speed = line.starts_with("speed_deg_per_s = 54.96");
        is_speed.then(|| "speed_deg_per_s = 27.48".to_owned())
    })?;
    edit(&folder.join("plan.toml"), |line| {
        let changed = match line {
            "theta_step_deg = 15" => "theta_step_deg = 40",
            "phi_step_deg = 30" => "phi_step_deg = 60",
            "angular_degree = 4" => "angular_degree = 2",
            "position_degree = 1" => "position_degree = 0",
            _ => return None,
        };
        Some(changed.to_owned())
    })
}

/// Puts the example's files there, with this kind of rig and this at the end of its file.
pub(crate) fn write(rig: &Rig, folder: &Path, fault: &str) -> Result<(), Unmeasured> {
    copy_example("servo-arm", folder)?;
    let path = folder.join("rig.toml");
    let text = std::fs::read_to_string(&path)?;
    let parts = || {
        let (before, after) = text.split_once("[[axes_link]]\n")?;
        let (_, meter) = after.split_once("[photometer]\n")?;
        let (meter, simulated) = meter.split_once("[simulated]")?;
        Some((before, meter, simulated))
    };
    let changed = || Unmeasured::because("examples/servo-arm/rig.toml is no longer as it was");
    let (before, meter, simulated) = parts().ok_or_else(changed)?;
    let new = match rig.axes {
        Axes::Servos => text.clone(),
        Axes::Native => format!("{before}[simulated]{simulated}"),
        Axes::Grbl => {
            let before = before.replace("readback = \"encoder\"", "readback = \"steps\"");
            format!("{before}[[axes_link]]\n{GRBL}[photometer]\n{meter}[simulated]{simulated}")
        }
    };
    std::fs::write(&path, new + fault)?;
    Ok(())
}
