//! Times of samples: SMPTE timecodes with fractions of a frame, clock times, plain seconds.
//!
//! Live Link Face writes `HH:MM:SS:FF.fff`, FF in frames of 60 a second (30 in older versions), with `;` before FF
//! where the device counts drop frames. Drop frame (SMPTE ST 12-1): numbers 0 and 1 (0 to 3 at 60) are left out at the
//! start of every minute but each tenth, so that the numbers follow the clock at 30000/1001 (60000/1001) frames a second.

/// One written time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Stamp {
    /// Seconds.
    Seconds(f64),
    /// Whole seconds of the day, frames and whether the numbers drop.
    Frames { seconds: u32, frame: f64, drop: bool },
}

/// Reads one time.
pub(super) fn parse(text: &str) -> Option<Stamp> {
    let text = text.trim();
    let parts: Vec<&str> = text.split([':', ';']).collect();
    let whole = |s: &str| s.parse::<u32>().ok().filter(|n| *n < 100_000);
    let fraction = |s: &str| {
        let plain = !s.is_empty() && s.bytes().all(|b| b.is_ascii_digit() || b == b'.');
        s.parse::<f64>().ok().filter(|n| plain && n.is_finite())
    };
    match parts[..] {
        [seconds] => fraction(seconds).map(Stamp::Seconds),
        [h, m, s] => {
            let (h, m, s) = (whole(h)?, whole(m).filter(|m| *m < 60)?, fraction(s).filter(|s| *s < 60.0)?);
            Some(Stamp::Seconds(f64::from(h) * 3600.0 + f64::from(m) * 60.0 + s))
        }
        [h, m, s, f] => {
            let (h, m, s) = (whole(h)?, whole(m).filter(|m| *m < 60)?, whole(s).filter(|s| *s < 60)?);
            let frame = fraction(f).filter(|f| *f < 1000.0)?;
            Some(Stamp::Frames { seconds: h * 3600 + m * 60 + s, frame, drop: text.contains(';') })
        }
        _ => None,
    }
}

/// How frames of a timecode count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rate {
    /// Frame numbers in a second.
    pub(super) base: u32,
    /// The clock runs at base * 1000 / 1001.
    pub(super) ntsc: bool,
    /// Numbers are left out.
    pub(super) drop: bool,
}

impl Rate {
    /// The rate that a take shows: the smallest common base above its highest frame number. A take of less than two
    /// seconds may not reach it: then 60, what the app writes.
    pub(super) fn of(stamps: &[Stamp], asked: Option<f64>) -> Self {
        let mut highest = 0.0_f64;
        let mut drop = false;
        let (mut first, mut last) = (u32::MAX, 0);
        for stamp in stamps {
            if let Stamp::Frames { seconds, frame, drop: this } = stamp {
                highest = highest.max(frame.floor());
                drop |= this;
                first = first.min(*seconds);
                last = last.max(*seconds);
            }
        }
        let whole_second_seen = last.saturating_sub(first) >= 2;
        let base = match asked {
            Some(rate) => rate.round().clamp(1.0, 1000.0) as u32,
            None if !whole_second_seen && highest < 60.0 => 60,
            None => [24, 25, 30, 48, 50, 60, 120, 240, 1000]
                .into_iter()
                .find(|b| f64::from(*b) > highest)
                .unwrap_or(1000),
        };
        let ntsc = drop || asked.is_some_and(|rate| (rate - rate.round()).abs() > 1e-4);
        Self { base, ntsc, drop: drop && base % 30 == 0 }
    }

    /// Seconds since midnight.
    pub(super) fn seconds(&self, stamp: Stamp) -> f64 {
        match stamp {
            Stamp::Seconds(s) => s,
            Stamp::Frames { seconds, frame, .. } => {
                let minutes = seconds / 60;
                let left_out = if self.drop { self.base / 15 * (minutes - minutes / 10) } else { 0 };
                let frames = f64::from(seconds) * f64::from(self.base) + frame - f64::from(left_out);
                frames / f64::from(self.base) * if self.ntsc { 1.001 } else { 1.0 }
            }
        }
    }
}
