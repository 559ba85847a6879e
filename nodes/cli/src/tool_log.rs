//! Log of the tools.

/// Initializes the log of the tools; nodes have their own.
pub fn init_logging() {
    let env = env_logger::Env::default().default_filter_or("warn");
    // A second command in one process (tests) keeps the first logger.
    let _ = env_logger::Builder::from_env(env)
        .format_timestamp(None)
        .format_target(false)
        // Commands warn of short receive buffers only after a loss.
        .filter_module(
            "lattice_runtime::node::shared::status",
            log::LevelFilter::Error,
        )
        .try_init();
}
