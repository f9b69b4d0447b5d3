//! Checks whether a text is well-formed XML, for tests of figures.

/// Checks that tags are closed in order, attributes are quoted and special characters are escaped.
///
/// Errors: the first fault, as text.
pub fn well_formed(svg: &str) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = svg;
    while let Some(start) = rest.find('<') {
        escaped(&rest[..start])?;
        let end = rest[start..].find('>').ok_or("a tag without an end")? + start;
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            if open.pop() != Some(name) {
                return Err(format!("</{name}> closes nothing"));
            }
            continue;
        }
        let (tag, empty) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
        let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
        for (k, part) in attributes.split('"').enumerate() {
            let fits = if k % 2 == 0 { part.is_empty() || part.trim_start().ends_with('=') } else { true };
            escaped(part)?;
            if !fits || part.contains('<') {
                return Err(format!("{part:?} in <{tag}>"));
            }
        }
        if attributes.matches('"').count() % 2 == 1 {
            return Err(format!("an open quote in <{tag}>"));
        }
        if !empty {
            open.push(name);
        }
    }
    if open.is_empty() && rest.trim().is_empty() { Ok(()) } else { Err(format!("left open: {open:?}")) }
}

fn escaped(text: &str) -> Result<(), String> {
    for entity in text.split('&').skip(1) {
        if !["amp;", "lt;", "gt;", "quot;", "apos;"].iter().any(|known| entity.starts_with(known)) {
            return Err(format!("a bare & before {entity:?}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::well_formed;

    #[test]
    fn malformed_xml_is_refused() {
        well_formed("<a b=\"c\"><d/>x &amp; y</a>\n").unwrap();
        for wrong in ["<a>", "<a></b>", "<a b=c/>", "<a b=\"c/>", "<a>&</a>", "<a>&nbsp;</a>", "</a>", "text"]
        {
            assert!(well_formed(wrong).is_err(), "{wrong}");
        }
    }
}
