//! Redirection of Cyclone's log to ours, and its errors as reasons of failed calls.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::c_void;
use std::ptr;
use std::slice;
use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

use lattice_cyclone_sys::{
    DDS_LC_ERROR, DDS_LC_FATAL, DDS_LC_WARNING, dds_entity_t, dds_log_data_t, dds_set_log_sink,
};
use log::Level;

use super::entity::Entity;
use crate::sync::lock;

/// Time before a line is repeated: Cyclone logs a rejected participant once a second.
const AGAIN: Duration = Duration::from_secs(60);

/// Limit of distinct lines in that time: an unauthenticated peer may change its name each time.
const MAX_LINES: usize = 100;

thread_local! {
    /// Errors of the current call on this thread, while they are collected.
    static REASONS: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Redirects Cyclone's log of this process.
pub(super) fn take_over() {
    static ONCE: Once = Once::new();
    // SAFETY: a function with static lifetime and without an argument.
    ONCE.call_once(|| unsafe { dds_set_log_sink(Some(on_line), ptr::null_mut()) });
}

/// Creates a Cyclone entity. The error is its return code with the errors that Cyclone reported on this
/// thread during the call; those are not logged.
pub(super) fn explained(make: impl FnOnce() -> dds_entity_t) -> Result<Entity, String> {
    REASONS.set(Some(Vec::new()));
    let made = Entity::new(make());
    let reasons = REASONS.take().unwrap_or_default();
    if made.is_ok() {
        reasons.iter().for_each(|text| tell(Level::Error, text));
    }
    made.map_err(|code| match reasons.is_empty() {
        true => code,
        false => format!("{code} ({})", reasons.join("; ")),
    })
}

/// # Safety
///
/// The line is valid during the call.
unsafe extern "C" fn on_line(_: *mut c_void, line: *const dds_log_data_t) {
    // SAFETY: see above; `message` has `size` bytes.
    let (text, priority) = unsafe {
        let Some(line) = line.as_ref() else { return };
        let text = slice::from_raw_parts(line.message.cast::<u8>(), line.size);
        (String::from_utf8_lossy(text), line.priority)
    };
    let text = text.trim();
    let is_error = priority & (DDS_LC_FATAL | DDS_LC_ERROR) != 0;
    let kept = REASONS.with_borrow_mut(|reasons| match reasons {
        Some(reasons) if is_error => {
            reasons.push(text.to_owned());
            true
        }
        _ => false,
    });
    let level = match priority {
        DDS_LC_WARNING => Level::Warn,
        _ if is_error => Level::Error,
        _ => Level::Info,
    };
    if !kept {
        tell(level, text);
    }
}

/// Logs a line unless it was logged in the last minute.
pub(super) fn tell(level: Level, text: &str) {
    if is_news(text, Instant::now()) {
        log::log!(level, "Cyclone DDS: {text}");
    }
}

fn is_news(text: &str, now: Instant) -> bool {
    static TOLD: Mutex<BTreeMap<String, Instant>> = Mutex::new(BTreeMap::new());
    let mut told = lock(&TOLD);
    told.retain(|_, at| now.saturating_duration_since(*at) < AGAIN);
    let news = told.len() < MAX_LINES && !told.contains_key(text);
    if news {
        let _ = told.insert(text.to_owned(), now);
    }
    news
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_told_again_after_a_while_and_many_are_not() {
        let start = Instant::now();
        assert!(is_news("refused", start) && !is_news("refused", start));
        assert!(is_news("refused", start + AGAIN) && !is_news("refused", start + AGAIN));
        let told = (0..1000).filter(|number| is_news(&number.to_string(), start + AGAIN));
        assert_eq!(told.count(), MAX_LINES - 1);
    }
}
