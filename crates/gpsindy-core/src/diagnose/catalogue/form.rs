//! The text of an effect's form, with its symbols replaced by names.

use crate::error::Result;
use crate::expression::Expression;

/// `form` with every symbol replaced, all at once, so that a variable may be called like a symbol.
///
/// # Errors
/// A form that is no expression.
pub(crate) fn written(form: &str, symbols: &[(&str, Expression)]) -> Result<Expression> {
    Ok(Expression::parse(form)?.map(&|part| match &part {
        Expression::Variable(name) => {
            symbols.iter().find(|(symbol, _)| symbol == name).map_or(part.clone(), |(_, e)| e.clone())
        }
        _ => part,
    }))
}

/// `text` with every whole word replaced for which there is another.
pub(crate) fn with_words<'a>(text: &str, other: impl Fn(&str) -> Option<&'a String>) -> String {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut written = String::new();
    let mut rest = text;
    while let Some(start) = rest.find(is_part) {
        let end = rest[start..].find(|c| !is_part(c)).map_or(rest.len(), |length| start + length);
        let word = &rest[start..end];
        written += &rest[..start];
        written += other(word).map_or(word, String::as_str);
        rest = &rest[end..];
    }
    written + rest
}
