//! Dates and times: those of ISO 8601, days with points (`01.05.2024`), slashes (`2024/05/01`) or an English month
//! (`01-May-2024`), times of day.

use crate::numerics::statistics::median;

/// Half a day, s: a clock of times of day that goes back by more is past midnight.
const HALF_DAY: f64 = 43_200.0;

/// Seconds since 1970, whole ones and the fraction, of `2024-05-01T12:00:00.02`, `20240501T120000.02`, or of
/// `01.05.2024 12:00:00`, or `01-May-2024 12:00:00` as MATLAB writes it. A blank for the `T`, `,` for the point, and `Z`, `UTC` or `+02:00` at the end are known, too.
/// The time of day alone counts from midnight; `12:00:00:020` has thousandths, `1:05.25` is minutes and seconds, `1 days 00:00:01.5`
/// or `1 day, 0:00:01.5` a duration of pandas or Python. `None` for anything else: `05/01/2024` is May in one country and January in another.
///
/// ```
/// use rfl_mpc::table::time::seconds;
///
/// assert_eq!(seconds("1970-01-02T00:00:01.5"), Some((86_401, 0.5)));
/// assert_eq!(seconds("1970-01-02 02:00:01+02:00"), Some((86_401, 0.0)));
/// assert_eq!(seconds("02.01.1970 00:00:01"), Some((86_401, 0.0)));
/// assert_eq!(seconds("19700102T020001+02:00"), Some((86_401, 0.0)));
/// assert_eq!(seconds("1970/01/02 00:00:01 UTC"), Some((86_401, 0.0)));
/// assert_eq!(seconds("02-Jan-1970 00:00:01"), Some((86_401, 0.0)));
/// assert_eq!(seconds("00:01:01.25"), Some((61, 0.25)));
/// assert_eq!(seconds("9:00:01:250"), Some((32_401, 0.25)));
/// assert_eq!(seconds("1:05.25"), Some((65, 0.25)));
/// assert_eq!(seconds("1 days 00:00:01.500000"), Some((86_401, 0.5)));
/// assert_eq!(seconds("1 day, 0:00:01"), Some((86_401, 0.0)));
/// assert_eq!(seconds("1970_01_02"), None);
/// ```
#[must_use]
pub fn seconds(text: &str) -> Option<(i64, f64)> {
    // Most fields are numbers.
    if !text.contains([':', 'T', 't']) {
        return None;
    }
    if let Some((days, time)) = of_duration(text) {
        return seconds(time).map(|(whole, fraction)| (86_400 * days + whole, fraction));
    }
    let apart = separated(text).or_else(|| in_figures(text));
    let text = apart.as_deref().unwrap_or(text);
    let (date, time) = match (text.get(..10), text.get(11..)) {
        (Some(date), Some(time)) if matches!(text.as_bytes()[10], b'T' | b't' | b' ') => (Some(date), time),
        _ => (None, text),
    };
    let (year, month, day) = match date {
        Some(date) => {
            let reversed = || three(date, '.', [2, 2, 4]).map(|(day, month, year)| (year, month, day));
            three(date, '-', [4, 2, 2]).or_else(|| three(date, '/', [4, 2, 2])).or_else(reversed)?
        }
        None => (1970, 1, 1),
    };
    let time = ["UTC", "GMT"].iter().find_map(|zone| time.strip_suffix(zone)).unwrap_or(time).trim_end();
    let (time, offset) = match time.find(['Z', 'z', '+', '-']) {
        None => (time, 0),
        Some(at) => (time[..at].trim_end(), zone(&time[at..])?),
    };
    let thousandths = || time.rsplit_once(':').filter(|(clock, part)| part.len() == 3 && clock.contains(':'));
    let (clock, fraction) = time.split_once(['.', ',']).or_else(thousandths).unwrap_or((time, "0"));
    if fraction.is_empty() || !fraction.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let (hour, minute, second) = if clock.len() == 5 && date.is_some() {
        let (hour, minute) = clock.split_once(':')?;
        (digits(hour, 2)?, digits(minute, 2)?, 0)
    } else if let (None, Some((minute, second))) =
        (date, clock.split_once(':').filter(|(_, rest)| rest.len() == 2))
    {
        // Without a fraction it may be hours and minutes.
        let minute = minute.parse::<u16>().ok().filter(|_| clock.len() < time.len())?;
        (i64::from(minute / 60), i64::from(minute % 60), digits(second, 2)?)
    } else if clock.as_bytes().get(1) == Some(&b':') {
        three(clock, ':', [1, 2, 2])?
    } else {
        three(clock, ':', [2, 2, 2])?
    };
    let within =
        (1..=12).contains(&month) && (1..=31).contains(&day) && hour < 25 && minute < 60 && second < 61;
    let whole = 86_400 * days(year, month, day) + 3600 * hour + 60 * minute + second - offset;
    within.then_some((whole, format!("0.{fraction}").parse().ok()?))
}

/// Days of a duration, and its time within the day.
fn of_duration(text: &str) -> Option<(i64, &str)> {
    let (count, rest) = text.split_once(' ')?;
    let time = ["days ", "day ", "days, ", "day, "].iter().find_map(|unit| rest.strip_prefix(unit))?;
    let count: u16 = count.parse().ok()?;
    time.starts_with(|digit: char| digit.is_ascii_digit()).then_some((i64::from(count), time))
}

/// `20240501T120000.02Z` with the marks between its figures.
fn separated(text: &str) -> Option<String> {
    let figures = |from: usize, to: usize| {
        text.get(from..to).filter(|part| part.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let marked = matches!(text.as_bytes().get(8), Some(b'T' | b't'));
    let (date, time) = (figures(0, 8).filter(|_| marked)?, figures(9, 15)?);
    let [year, month, day] = [&date[..4], &date[4..6], &date[6..]];
    let [hour, minute, second] = [&time[..2], &time[2..4], &time[4..]];
    Some(format!("{year}-{month}-{day}T{hour}:{minute}:{second}{}", &text[15..]))
}

/// `1-May-2024 12:00:00` with its month in figures.
fn in_figures(text: &str) -> Option<String> {
    const MONTHS: [&str; 12] = [
        "january",
        "february",
        "march",
        "april",
        "may",
        "june",
        "july",
        "august",
        "september",
        "october",
        "november",
        "december",
    ];
    let (day, rest) = text.split_once(['-', '/', '.', ' '])?;
    let (month, rest) = rest.split_once(['-', '/', '.', ' '])?;
    let day: u8 = day.parse().ok()?;
    let is_month = |name: &&str| month.eq_ignore_ascii_case(name) || month.eq_ignore_ascii_case(&name[..3]);
    let month = 1 + MONTHS.iter().position(is_month)?;
    let (year, time) = rest.split_at_checked(4)?;
    let time = time.strip_prefix(['T', ' '])?;
    Some(format!("{year}-{month:02}-{day:02}T{}", time.trim_start()))
}

/// Seconds that a zone (`Z`, `+02:00`, `-0330`) is ahead.
fn zone(text: &str) -> Option<i64> {
    if matches!(text, "Z" | "z") {
        return Some(0);
    }
    let sign = if text.starts_with('-') { -1 } else { 1 };
    let rest: String = text[1..].chars().filter(|&letter| letter != ':').collect();
    let minutes = if rest.len() > 2 { digits(rest.get(2..)?, 2)? } else { 0 };
    Some(sign * (3600 * digits(rest.get(..2)?, 2)? + 60 * minutes))
}

fn three(text: &str, mark: char, lengths: [usize; 3]) -> Option<(i64, i64, i64)> {
    let mut parts = text.split(mark);
    let mut next = |length| digits(parts.next()?, length);
    let found = (next(lengths[0])?, next(lengths[1])?, next(lengths[2])?);
    parts.next().is_none().then_some(found)
}

fn digits(text: &str, length: usize) -> Option<i64> {
    (text.len() == length && text.bytes().all(|byte| byte.is_ascii_digit())).then(|| text.parse().ok())?
}

/// Days since 1970-01-01 in the Gregorian calendar (H. Hinnant, days_from_civil).
fn days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let of_era = year - 400 * era;
    let of_year = (153 * (month + if month > 2 { -3 } else { 9 }) + 2) / 5 + day - 1;
    146_097 * era + 365 * of_era + of_era / 4 - of_era / 100 + of_year - 719_468
}

/// Seconds of times of day that are written as numbers, HHMMSS.ss, as VBOX and NMEA do; `None` for other numbers.
///
/// Within a minute both are the same. At a full minute such numbers jump by 40 more than the clock, at an hour by 4040.
/// They are taken for times of day only if the clock goes on evenly then, and no field is above 60.
#[must_use]
pub fn of_digits(values: &[f64]) -> Option<Vec<f64>> {
    let known = || values.iter().copied().filter(|value| value.is_finite());
    let is_time = |value: f64| {
        (0.0..240_000.0).contains(&value) && value % 100.0 <= 60.0 && (value / 100.0).floor() % 100.0 < 60.0
    };
    if !known().all(is_time) {
        return None;
    }
    let on_clock = |value: f64| {
        let minutes = (value / 100.0).floor();
        ((minutes / 100.0).floor() * 60.0 + minutes % 100.0) * 60.0 + value % 100.0
    };
    let (mut within, mut turns) = (Vec::new(), Vec::new());
    for (before, next) in known().zip(known().skip(1)) {
        let step = on_clock(next) - on_clock(before);
        // Past midnight.
        let step = if step < -HALF_DAY { step + 2.0 * HALF_DAY } else { step };
        if (before / 100.0).floor() != (next / 100.0).floor() {
            turns.push(step);
        } else if step > 0.0 {
            within.push(step);
        }
    }
    if !(0.5..3.0).contains(&(median(turns)? / median(within)?)) {
        return None;
    }
    let (mut days, mut before) = (0.0, f64::NAN);
    let seconds = |value: f64| {
        let clock = on_clock(value);
        if clock - before < -HALF_DAY {
            days += 1.0;
        }
        if clock.is_finite() {
            before = clock;
        }
        clock + days * 2.0 * HALF_DAY
    };
    Some(values.iter().copied().map(seconds).collect())
}
