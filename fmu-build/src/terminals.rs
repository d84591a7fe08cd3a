//! `terminalsAndIcons/` of an FMU: variables that are connected together, and the unit's picture.
//!
//! FMI 2.0.4 took the folder over from 3.0 as it is. Older hosts of 2.0 pass over it, and find the picture as `model.png`.
//!
//! A terminal is a bus: its members are matched by name, so that a controller, which asks for fewer signals than a vehicle
//! has, fits any of them. The buses are groups of the vocabulary; a model has those of whose signals it has some.

use crate::standard::Standard;
use crate::xml::{Attributes, Xml};
use rfl_mpc::fmi::{Causality, Declaration};
use rfl_mpc::signal::{self, Signal};

/// The folder's description.
pub const FILE: &str = "terminalsAndIcons/terminalsAndIcons.xml";

/// The icon, drawn by us: a road that a vehicle follows. The last is for 2.0 alone.
const ICONS: [(&str, &[u8]); 3] = [
    ("terminalsAndIcons/icon.png", include_bytes!("../icons/icon.png")),
    ("terminalsAndIcons/icon.svg", include_bytes!("../icons/icon.svg")),
    ("model.png", include_bytes!("../icons/icon.png")),
];

/// The icon's files in an FMU of a version.
#[must_use]
pub fn icons(standard: Standard) -> &'static [(&'static str, &'static [u8])] {
    match standard {
        Standard::Fmi2 => &ICONS,
        Standard::Fmi3 => &ICONS[..2],
    }
}

/// The buses: name, meaning, signals.
const TERMINALS: [(&str, &str, &[&Signal]); 3] = [
    ("pose", "Where the vehicle is", &[&signal::X, &signal::Y, &signal::YAW]),
    (
        "motion",
        "How the vehicle moves, and what its sensors read",
        &[
            &signal::VX,
            &signal::VY,
            &signal::YAW_RATE,
            &signal::AX,
            &signal::AY,
            &signal::STEER,
            &signal::ROLL,
            &signal::PITCH,
            &signal::ARTICULATION,
            &signal::ARTICULATION_RATE,
        ],
    ),
    ("command", "What the controller asks of the vehicle", &[&signal::STEER_CMD, &signal::ACCEL_CMD]),
];

/// Size of the icon in its own coordinates.
const SIZE: i32 = 100;

/// The description of terminals and icon.
#[must_use]
pub fn terminals(declaration: &Declaration) -> String {
    let mut xml = Xml::new();
    xml.open("fmiTerminalsAndIcons", Attributes::new().with("fmiVersion", "3.0"));
    xml.open("GraphicalRepresentation", Attributes::new());
    let corners = || Attributes::new().with("x1", 0).with("y1", 0).with("x2", SIZE).with("y2", SIZE);
    xml.empty("CoordinateSystem", corners().with("suggestedScalingFactorTo_mm", 0.1));
    xml.empty("Icon", corners());
    xml.close();
    let is_connected = |signal: &&&Signal| {
        declaration.variables.iter().any(|variable| {
            variable.name == signal.name && matches!(variable.causality, Causality::Input | Causality::Output)
        })
    };
    let terminals: Vec<(_, _, Vec<_>)> = TERMINALS
        .iter()
        .map(|(name, meaning, signals)| (*name, *meaning, signals.iter().filter(is_connected).collect()))
        .filter(|(_, _, members): &(_, _, Vec<_>)| !members.is_empty())
        .collect();
    if !terminals.is_empty() {
        xml.open("Terminals", Attributes::new());
        for (name, meaning, members) in terminals {
            let attributes = Attributes::new().with("name", name).with("matchingRule", "bus");
            xml.open("Terminal", attributes.with("description", meaning));
            for member in members {
                let attributes = Attributes::new().with("variableName", member.name);
                let attributes = attributes.with("memberName", member.name);
                xml.empty("TerminalMemberVariable", attributes.with("variableKind", "signal"));
            }
            xml.close();
        }
        xml.close();
    }
    xml.close();
    xml.finish()
}
