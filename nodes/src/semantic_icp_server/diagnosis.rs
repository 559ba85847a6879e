//! Diagnostic status of a server.

use lattice_runtime::Level;

use super::counts::ServerReport;
use super::state::SemanticIcpServer;
use crate::report;

/// Level, text and values.
pub(super) fn diagnosis(
    machine: &SemanticIcpServer,
    report: &ServerReport<'_>,
) -> (Level, String, Vec<(String, String)>) {
    let last = machine.last_result();
    let (level, message) = if machine.map_voxels() == 0 {
        (Level::Warn, "no map yet".to_owned())
    } else if report.counts.clouds_in == 0 {
        (Level::Warn, "no cloud of the headset yet".to_owned())
    } else if machine.map_from_headset().is_some() {
        (Level::Ok, "calibrated".to_owned())
    } else {
        (Level::Warn, format!("not calibrated: {}", last.reason))
    };
    let mut values = report::key_values(report);
    values.extend([
        ("session".into(), last.session.clone()),
        ("last_reason".into(), last.reason.clone()),
        ("method".into(), last.method.clone()),
    ]);
    for class in &last.class_reliability {
        let name = machine.class_name(class.class_id);
        let name = name.map_or_else(|| class.class_id.to_string(), str::to_owned);
        let worth = format!("agrees {:.2}, weight {:.2}", class.agreement, class.weight);
        values.push((format!("class {name}"), worth));
    }
    (level, message, values)
}
