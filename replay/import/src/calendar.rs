//! Dates and times of day in foreign logs.

/// Nanoseconds in a day.
pub(crate) const DAY_NS: u64 = 86_400_000_000_000;

/// Returns the number of days from the start of 1970 to a date; `None` if the calendar lacks the date, or it isn't
/// within 1970 to 2199.
pub(crate) fn days_since_1970(year: u64, month: u64, day: u64) -> Option<u64> {
    const LENGTHS: [u64; 12] = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let is_leap =
        |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    let before = usize::try_from(month).ok()?.checked_sub(1)?;
    let length = LENGTHS.get(before)? + u64::from(month == 2 && is_leap(year));
    if !(1970..2200).contains(&year) || !(1..=length).contains(&day) {
        return None;
    }
    let years: u64 = (1970..year).map(|year| if is_leap(year) { 366 } else { 365 }).sum();
    let months: u64 = LENGTHS.iter().take(before).sum();
    Some(years + months + u64::from(month > 2 && is_leap(year)) + day - 1)
}

/// Parses a time of day, `hh:mm:ss` with a fraction of up to nine digits.
pub(crate) fn time_of_day_ns(text: &str) -> Option<u64> {
    let (clock, fraction) = text.split_once('.').unwrap_or((text, "0"));
    let mut parts = clock.split(':');
    let mut part = |limit: u64| parts.next().and_then(digits).filter(|part| *part < limit);
    let seconds = (part(24)? * 60 + part(60)?) * 60 + part(60)?;
    let places = u32::try_from(fraction.len()).ok().and_then(|len| 9_u32.checked_sub(len))?;
    let fraction_ns = digits(fraction)? * 10_u64.pow(places);
    parts.next().is_none().then_some(seconds * 1_000_000_000 + fraction_ns)
}

/// Parses a date and time of ISO 8601, such as `2026-05-04T12:30:00.5+02:00`, with a space or `T` in the middle.
///
/// Returns the nanoseconds from the start of 1970, and whether the text states the time zone. Without a zone, the
/// nanoseconds count on the local clock.
pub(crate) fn iso_8601_ns(text: &str) -> Option<(u64, bool)> {
    let (date, time) = text.split_once(['T', 't', ' '])?;
    let mut parts = date.split('-').map(digits);
    let mut part = || parts.next().flatten();
    let days = days_since_1970(part()?, part()?, part()?)?;
    if parts.next().is_some() {
        return None;
    }
    let (time, zone) = match time.find(['Z', 'z', '+', '-']) {
        Some(at) => time.split_at_checked(at)?,
        None => (time, ""),
    };
    let local_ns = (days * DAY_NS).checked_add(time_of_day_ns(time.trim_end())?)?;
    let Some((sign, offset)) = zone.split_at_checked(1) else { return Some((local_ns, false)) };
    let (hours, minutes) = match (sign, offset.len()) {
        ("Z" | "z", 0) => ("0", "0"),
        ("+" | "-", 2) => (offset, "0"),
        ("+" | "-", 4) => offset.split_at_checked(2)?,
        ("+" | "-", 5) => offset.split_once(':')?,
        _ => return None,
    };
    let (hours, minutes) = (digits(hours).filter(|it| *it < 24)?, digits(minutes).filter(|it| *it < 60)?);
    let offset_ns = (hours * 60 + minutes) * 60_000_000_000;
    let utc_ns = if sign == "-" { local_ns.checked_add(offset_ns) } else { local_ns.checked_sub(offset_ns) };
    Some((utc_ns?, true))
}

/// Parses decimal digits. Other characters, such as signs, are refused.
pub(crate) fn digits(text: &str) -> Option<u64> {
    let is_number = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    if is_number { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_converted_to_days_since_1970() {
        assert_eq!(days_since_1970(1970, 1, 1), Some(0));
        assert_eq!(days_since_1970(2000, 3, 1), Some(11_017));
        assert_eq!(days_since_1970(2016, 11, 18), Some(17_123));
        assert_eq!(days_since_1970(2100, 12, 31), Some(47_846));
        for (year, month, day) in [(2000, 1, 0), (2000, 13, 1), (1969, 1, 1), (2023, 2, 29), (2024, 4, 31)] {
            assert_eq!(days_since_1970(year, month, day), None);
        }
    }

    #[test]
    fn iso_8601_times_are_parsed_to_the_nanosecond_with_their_zone() {
        let noon_ns = 1_700_000_000_000_000_000;
        for text in [
            "2023-11-14T22:13:20Z",
            "2023-11-14 22:13:20.000+00",
            "2023-11-15T00:13:20+02:00",
            "2023-11-14T16:43:20-0530",
        ] {
            assert_eq!(iso_8601_ns(text), Some((noon_ns, true)), "{text}");
        }
        assert_eq!(iso_8601_ns("2023-11-14T22:13:20.123456789"), Some((noon_ns + 123_456_789, false)));
        for text in [
            "1700000000",
            "2023-11-14",
            "14.11.2023 22:13:20",
            "2023-02-29T00:00:00Z",
            "2023-11-14T24:00:00Z",
            "2023-11-14T22:13:20.1234567890Z",
            "2023-11-14T22:13:20+2",
            "2023-11-14T22:13:20Zulu",
            "1970-01-01T00:00:00+01:00",
            "2023-11-14T22:13:20é",
        ] {
            assert_eq!(iso_8601_ns(text), None, "{text}");
        }
    }
}
