//! Column headers: `heading angle (rad), from x-axis` is the column `heading_angle` in rad.

/// A column's header, split into name and unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// The whole text, trimmed.
    pub text: String,
    /// The text up to the first `[`, `(` or `,`, trimmed, other characters than letters, digits and `_` turned into `_`.
    pub name: String,
    /// What is in the first pair of brackets or parentheses; empty where there is none.
    pub unit: String,
}

impl Header {
    /// Splits the text of a header.
    ///
    /// ```
    /// use gpsindy_files::Header;
    /// let header = Header::parse("heading angle (rad), from x-axis");
    /// assert_eq!((header.name.as_str(), header.unit.as_str()), ("heading_angle", "rad"));
    /// ```
    pub fn parse(text: &str) -> Self {
        let text = text.trim();
        let end = text.find(['[', '(', ',']).unwrap_or(text.len());
        let (name, rest) = text.split_at(end);
        let name = name
            .trim()
            .chars()
            .filter(|c| gpsindy_core::shows(*c))
            .map(|c| if c.is_alphanumeric() || c == '_' { c } else { '_' })
            .collect();
        // A quoted header may hold a line break; a unit is one line of text.
        let unit = unit(rest).split(char::is_control).collect::<Vec<_>>().join(" ");
        let unit = unit.chars().filter(|c| gpsindy_core::shows(*c)).collect();
        Self { text: text.into(), name, unit }
    }

    /// Whether an option that says `column` means this one: by its name or by its whole header.
    pub fn answers_to(&self, column: &str) -> bool {
        self.name == column || self.text == column.trim()
    }
}

fn unit(rest: &str) -> &str {
    let Some(open) = rest.find(['[', '(']) else { return "" };
    let inside = &rest[open + 1..];
    let close = if rest[open..].starts_with('[') { ']' } else { ')' };
    inside.find(close).map_or("", |end| inside[..end].trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_is_a_name_and_a_unit() {
        for (text, name, unit) in [
            ("v [m/s]", "v", "m/s"),
            ("v[m/s]", "v", "m/s"),
            ("heading angle (rad), from x-axis", "heading_angle", "rad"),
            ("  x  ", "x", ""),
            ("x, as measured [m]", "x", "m"),
            ("motor-current", "motor_current", ""),
            ("i [A", "i", ""),
            ("[m]", "", "m"),
            ("dx/dt (m/s)", "dx_dt", "m/s"),
            ("\u{3b8} [rad]", "\u{3b8}", "rad"),
            ("k [N/(m s)]", "k", "N/(m s)"),
            ("k [N\nm]", "k", "N m"),
            ("\u{feff}v\u{ad}x [m\u{feff}/s]", "vx", "m/s"),
        ] {
            let header = Header::parse(text);
            assert_eq!((header.name.as_str(), header.unit.as_str()), (name, unit), "{text}");
        }
    }

    #[test]
    fn a_column_answers_to_its_name_and_to_its_whole_header() {
        let header = Header::parse("v [m/s]");
        assert!(header.answers_to("v") && header.answers_to("v [m/s]") && header.answers_to(" v [m/s] "));
        assert!(!header.answers_to("v [km/h]"));
    }
}
