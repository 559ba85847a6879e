//! The services `~/get_logger_levels` and `~/set_logger_levels`, which every node has.

use lattice_msgs::rcl_interfaces::{
    GetLoggerLevels, GetLoggerLevelsRequest, GetLoggerLevelsResponse, LoggerLevel, SetLoggerLevels,
    SetLoggerLevelsRequest, SetLoggerLevelsResponse, SetLoggerLevelsResult,
};

use super::logical_node::Node;
use crate::communication::service::Server;
use crate::error::RuntimeError;
use crate::logging;

/// Limit of loggers per request.
const MAX_LOGGERS: usize = 100;

/// Serves both services.
pub(crate) fn serve(node: &Node) -> Result<[Server; 2], RuntimeError> {
    Ok([
        node.service::<GetLoggerLevels>("~/get_logger_levels", |request| get(&request))?,
        node.service::<SetLoggerLevels>("~/set_logger_levels", |request| set(&request))?,
    ])
}

fn get(request: &GetLoggerLevelsRequest) -> GetLoggerLevelsResponse {
    let names = request.names.iter().take(MAX_LOGGERS);
    let level = |name: &String| LoggerLevel {
        name: name.clone(),
        level: logging::level(name),
    };
    GetLoggerLevelsResponse {
        levels: names.map(level).collect(),
    }
}

fn set(request: &SetLoggerLevelsRequest) -> SetLoggerLevelsResponse {
    let set_one = |(place, wanted): (usize, &LoggerLevel)| {
        let set = match place < MAX_LOGGERS {
            true => logging::set_level(&wanted.name, wanted.level),
            false => Err(format!("request exceeds {MAX_LOGGERS} loggers")),
        };
        SetLoggerLevelsResult {
            successful: set.is_ok(),
            reason: set.err().unwrap_or_default(),
        }
    };
    let levels = request.levels.iter().enumerate();
    SetLoggerLevelsResponse {
        results: levels.map(set_one).collect(),
    }
}
