//! Keyboard controls of a player in a terminal, as in `ros2 bag play`.

use std::io::{IsTerminal, Read, stdin};
use std::sync::mpsc::Sender;
use std::thread;

use rustix::process::getpgrp;
use rustix::termios::{LocalModes, OptionalActions, Termios, tcgetattr, tcgetpgrp, tcsetattr};

use super::commands::Command;
use super::playback::Playback;
use super::steps::Steps;

/// Factor of the rate per key press.
const RATE_STEP: f64 = 1.1;

/// Terminal in raw mode; dropping it restores the terminal.
pub(super) struct Keyboard(Termios);

impl Keyboard {
    /// Reads keys if the process has the terminal in the foreground; `None` otherwise.
    pub(super) fn start(controls: Sender<Command<Playback>>) -> Option<Self> {
        if !stdin().is_terminal() || !is_foreground() {
            return None;
        }
        let before = tcgetattr(stdin()).ok()?;
        let mut modes = before.clone();
        modes.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        tcsetattr(stdin(), OptionalActions::Now, &modes).ok()?;
        let this = Self(before);
        let thread = thread::Builder::new().name("keyboard".to_owned());
        // The thread still waits for a key when the process ends.
        let _ = thread.spawn(move || read_keys(&controls)).ok()?;
        log::info!("space: pause; arrows: right next message, up faster, down slower");
        Some(this)
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        // Changing the terminal from the background would stop the process.
        if is_foreground() {
            let _ = tcsetattr(stdin(), OptionalActions::Now, &self.0);
        }
    }
}

fn is_foreground() -> bool {
    tcgetpgrp(stdin()).is_ok_and(|foreground| foreground == getpgrp())
}

fn read_keys(controls: &Sender<Command<Playback>>) {
    let mut keys = Keys::default();
    for byte in stdin().lock().bytes().map_while(Result::ok) {
        if let Some(press) = keys.press(byte)
            && controls.send(Box::new(press)).is_err()
        {
            return;
        }
    }
}

/// Escape sequence read so far.
#[derive(Default)]
struct Keys {
    escape: u8,
}

impl Keys {
    /// Command completed by a byte, if any.
    fn press(&mut self, byte: u8) -> Option<fn(&mut Playback)> {
        let before = std::mem::take(&mut self.escape);
        match (before, byte) {
            (_, 0x1b) => self.escape = 1,
            (1, b'[' | b'O') => self.escape = 2,
            (2, b'A') => return Some(|playback| turn(playback, RATE_STEP)),
            (2, b'B') => return Some(|playback| turn(playback, 1.0 / RATE_STEP)),
            (2, b'C') => {
                return Some(|playback| playback.play_steps(Steps::new(Some(1), drop)));
            }
            (0, b' ') => return Some(Playback::toggle),
            _ => {}
        }
        None
    }
}

fn turn(playback: &mut Playback, factor: f64) {
    let rate = playback.player.rate() * factor;
    playback.set_rate(rate);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_apart() {
        let pressed = |bytes: &[u8]| {
            let mut keys = Keys::default();
            bytes.iter().filter_map(|byte| keys.press(*byte)).count()
        };
        assert_eq!(pressed(b" x "), 2);
        assert_eq!(pressed(b"\x1b[A\x1bOB\x1b[C"), 3);
        // The left arrow, a lone escape, letters of arrows without one.
        assert_eq!(pressed(b"\x1b[D\x1b\x1b[AABC\x1b "), 1);
    }
}
