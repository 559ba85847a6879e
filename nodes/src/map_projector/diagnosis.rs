//! Diagnostic status of the node.

use super::counts::ProjectorReport;
use super::machine::MapProjector;
use lattice_runtime::Level;

/// Level and message; `draws` is false while the map is followed for paths alone.
pub(super) fn diagnosis(
    machine: &MapProjector,
    report: &ProjectorReport,
    is_followed: bool,
    draws: bool,
) -> (Level, String) {
    let (level, message) = match (machine.error(), report.counts.messages_refused) {
        _ if !is_followed => (Level::Ok, "nobody subscribes to projected_map or elevation"),
        (Some(error), _) => return (Level::Error, error.to_string()),
        (None, 0) if report.counts.messages_in == 0 => (Level::Warn, "no map yet"),
        (None, 0) if !draws => (Level::Ok, "the map is followed for paths"),
        (None, 0) if report.cells == [0; 3] => (Level::Warn, "no grid yet"),
        (None, 0) if report.cells.first() == Some(&0) => {
            let text = "no free cell: no ground below base_frame, or limits are too tight";
            (Level::Warn, text)
        }
        (None, 0) if machine.misses_robot() => {
            let text = "no elevation: no transform from base_frame; check /tf, or set elevation_length_m: 0";
            (Level::Warn, text)
        }
        (None, 0) => (Level::Ok, "OK"),
        (None, refused) => return (Level::Warn, format!("{refused} messages rejected")),
    };
    (level, message.to_owned())
}
