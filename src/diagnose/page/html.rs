//! Text, numbers and tables in HTML.

/// Text that cannot be taken for markup.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            letter => safe.push(letter),
        }
    }
    safe
}

/// A number with at most three significant digits.
pub(super) fn number(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    if value == 0.0 {
        return "0".into();
    }
    let digits = 2 - value.abs().log10().floor() as i32;
    if (-4..=6).contains(&digits) {
        let text = format!("{value:.*}", digits.max(0) as usize);
        let text = if digits > 0 { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
        return if value < 0.0 { text.replacen('-', "−", 1) } else { text.to_owned() };
    }
    format!("{value:.2e}")
}

/// A share in percent.
pub(super) fn percent(share: f64) -> String {
    if !share.is_finite() {
        return "–".into();
    }
    // No break before the sign of percent, and no minus zero.
    let whole = (100.0 * share).round();
    format!("{}{:.0}\u{a0}%", if whole < 0.0 { "−" } else { "" }, whole.abs())
}

/// A table; cells are HTML already. `text` is the number of the first columns that are text.
pub(super) fn table(header: &[&str], rows: &[Vec<String>], text: usize) -> String {
    let class = |place: usize| if place < text { "" } else { " class='n'" };
    let mut html = String::from("<div class='scroll'><table><thead><tr>");
    for (place, name) in header.iter().enumerate() {
        html += &format!("<th{}>{}</th>", class(place), escaped(name));
    }
    html += "</tr></thead><tbody>";
    for row in rows {
        html += "<tr>";
        for (place, cell) in row.iter().enumerate() {
            html += &format!("<td{}>{cell}</td>", class(place));
        }
        html += "</tr>";
    }
    html + "</tbody></table></div>"
}

/// The unit of a compared signal; `along` and `across` are the place, seen from the vehicle.
pub(super) fn unit_of(name: &str) -> &'static str {
    match name {
        "along" | "across" => "m",
        name => crate::signal::find(name).map_or("", |signal| signal.unit.symbol),
    }
}

/// A drawing with words under it; nothing where there is no drawing. `caption` is HTML.
pub(super) fn figure(svg: &str, caption: &str) -> String {
    if svg.is_empty() {
        String::new()
    } else {
        format!("<figure>{svg}<figcaption>{caption}</figcaption></figure>")
    }
}

/// A section with a heading; nothing where it is empty.
pub(super) fn section(title: &str, body: &str) -> String {
    if body.is_empty() {
        String::new()
    } else {
        format!("<section id='{}'><h2>{}</h2>{body}</section>", anchor(title), escaped(title))
    }
}

/// A title as the target of a link.
fn anchor(title: &str) -> String {
    let letters = title.chars().map(|letter| if letter.is_alphanumeric() { letter } else { '-' });
    letters.collect::<String>().to_lowercase()
}

/// Links to the sections that are there.
pub(super) fn contents(sections: &[(&str, String)]) -> String {
    let there = sections.iter().filter(|(_, body)| !body.is_empty());
    let link = |(title, _): &(&str, String)| format!("<a href='#{}'>{}</a>", anchor(title), escaped(title));
    format!("<nav>{}</nav>", there.map(link).collect::<String>())
}

/// Section that is shown on demand.
pub(super) fn folded(summary: &str, body: &str) -> String {
    format!("<details><summary>{}</summary>{body}</details>", escaped(summary))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        let cases = [
            (0.0123456, "0.0123"),
            (0.0700, "0.07"),
            (4.0, "4"),
            (-12.3456, "−12.3"),
            (1234.5, "1234"),
            (1e9, "1.00e9"),
            (f64::NAN, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn markup_in_text_stays_text() {
        assert_eq!(escaped("<script>'\"&"), "&lt;script&gt;&#39;&quot;&amp;");
    }
}
