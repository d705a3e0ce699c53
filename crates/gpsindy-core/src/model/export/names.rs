//! Names of a model as identifiers of a programming language, and its free text as words of a comment.
//!
//! Names and units come from the author of a model file and must not end a comment or a string: [`Model::check`] refuses
//! invisible characters, and this file escapes every other mark that a language interprets inside a comment or a string.

use super::super::Model;
use std::collections::BTreeMap;

/// Keywords of all languages, and names that the generated programs use themselves in one of them.
const RESERVED: &str = "\
    abstract algorithm and as assert async auto await become begin bisect bool box break case catch char \
    class connect const constant continue control CONTROLS controls_list crate def default del der discrete \
    do double dx dyn e each earlier elif else elseif elsewhen encapsulated end enum EOF equation equations \
    Err except expandable export extends extern f fabs False false final finally float flow fmax fmin fn for \
    from function global goto half history HUGE_VAL if im impl import impure in Inf INFINITY initial \
    INITIAL_STATE initial_state inline inner input int is lambda last late let linux local long loop M_1_PI \
    M_2_PI M_2_SQRTPI M_E M_LN10 M_LN2 M_LOG10E M_LOG2E M_PI M_PI_2 M_PI_4 M_SQRT1_2 M_SQRT2 macro match \
    math middle missing mod model module move mut N_CONTROLS N_HISTORY N_LATE N_STATES NAN NaN None nonlocal \
    not nothing NULL Ok operator or outer output outputs override package parameter PARAMETERS parameters \
    parameters_list partial pass pow power priv protected pub public pure pushed quote raise range rates \
    Real Record record record_t redeclare ref register replaceable restrict return Self self short signal \
    signed simulate sizeof Some sp state STATES states_list static stream struct super switch then time \
    trait True true try type typedef typeof union unix unsafe unsigned unsized use using values virtual void \
    volatile when where while with within y yield";

/// Whether a word means something in one of the languages or in a generated program.
pub(super) fn is_reserved(word: &str) -> bool {
    RESERVED.split_whitespace().any(|reserved| reserved == word)
}

/// `name` as an identifier of ASCII letters that is no keyword.
fn identifier(name: &str) -> String {
    let mut written = String::new();
    for character in name.chars() {
        if character.is_ascii_alphanumeric() || character == '_' {
            written.push(character);
        } else {
            written.push_str(&format!("u{:04x}", character as u32));
        }
    }
    let own = |stem: &str| {
        written.strip_prefix(stem).is_some_and(|rest| !rest.is_empty() && rest.chars().all(|c| c.is_ascii_digit()))
    };
    let is_taken = is_reserved(&written) || own("history_") || own("signal_");
    if is_taken || written.chars().all(|c| c == '_') {
        written.push_str("_v");
    }
    written
}

/// The identifiers of all names of a model, no two of them the same.
pub(super) fn identifiers(model: &Model) -> BTreeMap<String, String> {
    let mut given: BTreeMap<String, String> = BTreeMap::new();
    for name in model.names() {
        let plain = identifier(name);
        let mut chosen = plain.clone();
        let mut number = 2;
        while given.values().any(|other| *other == chosen) || (chosen != name && model.names().any(|n| n == chosen)) {
            chosen = format!("{plain}_{number}");
            number += 1;
        }
        given.insert(name.into(), chosen);
    }
    given
}

/// A model's name, which is free text, as the beginning of identifiers: `cart & pole` gives `cart_pole`.
pub(super) fn title(name: &str) -> String {
    /// Longer names serve nobody, and some compilers look at 63 characters.
    const LONGEST: usize = 40;
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    let mut title: String = words.collect::<Vec<_>>().join("_").chars().take(LONGEST).collect();
    if !title.starts_with(|c: char| c.is_ascii_alphabetic()) {
        title.insert_str(0, if title.is_empty() { "model" } else { "model_" });
    }
    title
}

/// Text for a comment that ends with its line.
pub(super) fn line_comment(text: &str) -> String {
    text.replace(char::is_control, " ")
}

/// Text for a comment of C: neither mark of a comment, and no trigraph.
pub(super) fn block_comment(text: &str) -> String {
    let mut written = String::new();
    for character in line_comment(text).chars() {
        let last = written.chars().next_back();
        if matches!((last, character), (Some('*'), '/') | (Some('/'), '*') | (Some('?'), '?')) {
            written.push(' ');
        }
        written.push(character);
    }
    written
}

/// Text for a string of Python in quotes of any kind.
pub(super) fn python_string(text: &str) -> String {
    line_comment(text).replace('\\', "\\\\").replace('"', "\\\"").replace('\'', "\\'")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::model::{Parameter, State};

    #[test]
    fn keywords_and_foreign_letters_get_another_identifier() {
        for (name, wanted) in [
            ("lambda", "lambda_v"),
            ("\u{e9}", "u00e9"),
            ("_", "__v"),
            ("history_0", "history_0_v"),
            ("history_a", "history_a"),
            ("omega", "omega"),
        ] {
            assert_eq!(identifier(name), wanted);
        }
    }

    #[test]
    fn two_names_never_become_one_identifier() {
        let model = Model {
            states: vec![State::new("\u{e9}", Expression::Pi), State::new("u00e9", Expression::Pi)],
            parameters: vec![Parameter::new("lambda", 1.0), Parameter::new("lambda_v", 2.0)],
            ..Model::default()
        };
        let given = identifiers(&model);
        assert_eq!(given.values().collect::<std::collections::BTreeSet<_>>().len(), 4, "{given:?}");
        assert_eq!(given["u00e9"], "u00e9");
        assert_eq!(given["lambda_v"], "lambda_v");
    }

    #[test]
    fn a_title_is_a_short_identifier() {
        for (name, wanted) in
            [("cart & pole", "cart_pole"), ("", "model"), ("2dof", "model_2dof"), ("*/", "model"), ("Arm 6", "Arm_6")]
        {
            assert_eq!(title(name), wanted);
        }
        assert!(title(&"x".repeat(99)).len() <= 40);
    }

    #[test]
    fn nothing_in_a_text_ends_its_comment() {
        assert_eq!(block_comment("a*/b/*/c??/"), "a* /b/ * /c? ?/");
        assert_eq!(python_string("\"\"\"\\N{x}"), "\\\"\\\"\\\"\\\\N{x}");
        assert_eq!(line_comment("m\ns"), "m s");
    }
}
