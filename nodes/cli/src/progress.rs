//! Progress bars on standard error, hidden unless it is a terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Progress bar from 0 to 1.
pub struct Progress(ProgressBar);

const STEPS: u64 = 1000;

impl Progress {
    /// Progress bar with a name.
    pub fn new(name: &str) -> Self {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) =
            ProgressStyle::with_template("{prefix:<12} {bar:40} {percent:>3} % {msg}")
        {
            bar.set_style(style);
        }
        bar.set_prefix(name.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        Self(bar)
    }

    /// Sets the completed fraction.
    pub fn set(&self, done: f64) {
        self.0
            .set_position((done.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }

    /// Sets the text after the bar.
    pub fn say(&self, text: &str) {
        self.0.set_message(text.to_owned());
    }

    /// Prints a line above the bar.
    #[cfg(feature = "bags")]
    pub fn print(&self, line: &str) {
        self.0.suspend(|| eprintln!("{line}"));
    }

    /// Removes the bar.
    pub fn done(self) {
        self.0.finish_and_clear();
    }
}
