//! Reads expressions: operator precedence by binding powers (Pratt 1973, Top down operator precedence).

use super::{Expression, Function, Operator};
use crate::error::{Error, Result};

/// Deeper nesting than any formula has; guards the stack against hostile input.
const MAX_DEPTH: usize = 200;

/// Most operations one above the other: a sum of n terms is a tree of that height. Whatever walks an expression goes down it by one call a
/// step, and the largest walk, that of an export, survives 2000 of them on a thread of 2 MB; effects of a diagnosis come on top.
const MAX_HEIGHT: usize = 1000;

/// An expression and the height of its tree.
type Tree = (Expression, usize);

#[derive(Debug, Clone, PartialEq)]
enum Token {
    Number(f64),
    Name(String),
    Symbol(char),
    End,
}

struct Parser<'a> {
    text: &'a str,
    /// Tokens with their places, counted from 1 in characters.
    tokens: Vec<(Token, usize)>,
    next: usize,
    depth: usize,
}

pub(super) fn parse(text: &str) -> Result<Expression> {
    let mut parser = Parser { text, tokens: tokenize(text)?, next: 0, depth: 0 };
    let (expression, _) = parser.expression(0)?;
    match parser.peek() {
        Token::End => Ok(expression),
        _ => Err(parser.unexpected("an operator or the end")),
    }
}

fn tokenize(text: &str) -> Result<Vec<(Token, usize)>> {
    let characters: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let mut i = 0;
    while i < characters.len() {
        let c = characters[i];
        let place = i + 1;
        if c.is_whitespace() {
            i += 1;
        } else if c.is_ascii_digit() || c == '.' {
            let end = number_end(&characters, i);
            let word: String = characters[i..end].iter().collect();
            let value = word.parse().map_err(|_| error(text, place, format!("`{word}` is not a number")))?;
            tokens.push((Token::Number(value), place));
            i = end;
        } else if c.is_alphabetic() || c == '_' {
            let start = i;
            while i < characters.len() && (characters[i].is_alphanumeric() || characters[i] == '_') {
                i += 1;
            }
            tokens.push((Token::Name(characters[start..i].iter().collect()), place));
        } else if c == '*' && characters.get(i + 1) == Some(&'*') {
            tokens.push((Token::Symbol('^'), place));
            i += 2;
        } else if "+-*/^(),".contains(c) {
            tokens.push((Token::Symbol(c), place));
            i += 1;
        } else {
            return Err(error(text, place, format!("`{c}` is not part of the language")));
        }
    }
    tokens.push((Token::End, characters.len() + 1));
    Ok(tokens)
}

fn number_end(characters: &[char], start: usize) -> usize {
    let digit = |i: usize| characters.get(i).is_some_and(char::is_ascii_digit);
    let mut i = start;
    while digit(i) || characters.get(i) == Some(&'.') {
        i += 1;
    }
    if matches!(characters.get(i), Some('e' | 'E')) {
        let sign = usize::from(matches!(characters.get(i + 1), Some('+' | '-')));
        if digit(i + 1 + sign) {
            i += 1 + sign;
            while digit(i) {
                i += 1;
            }
        }
    }
    i
}

fn error(text: &str, position: usize, message: String) -> Error {
    Error::Parse { text: text.into(), position, message }
}

impl Parser<'_> {
    fn peek(&self) -> &Token {
        &self.tokens[self.next].0
    }

    fn advance(&mut self) -> Token {
        let token = self.tokens[self.next].0.clone();
        if self.next + 1 < self.tokens.len() {
            self.next += 1;
        }
        token
    }

    fn unexpected(&self, expected: &str) -> Error {
        let (token, place) = &self.tokens[self.next];
        let found = match token {
            Token::Number(value) => format!("`{value}`"),
            Token::Name(name) => format!("`{name}`"),
            Token::Symbol(symbol) => format!("`{symbol}`"),
            Token::End => "the end".into(),
        };
        error(self.text, *place, format!("expected {expected}, found {found}"))
    }

    fn expect(&mut self, symbol: char) -> Result<()> {
        if *self.peek() == Token::Symbol(symbol) {
            self.advance();
            return Ok(());
        }
        Err(self.unexpected(&format!("`{symbol}`")))
    }

    /// Parses as long as the operators bind at least as tightly as `minimum`.
    fn expression(&mut self, minimum: u8) -> Result<Tree> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(error(self.text, self.tokens[self.next].1, format!("nested deeper than {MAX_DEPTH}")));
        }
        let (mut left, mut height) = self.operand()?;
        while let Token::Symbol(symbol) = *self.peek() {
            // (binding power to the left, to the right); the power operator is right associative.
            let (operator, left_power, right_power) = match symbol {
                '+' => (Operator::Add, 1, 2),
                '-' => (Operator::Subtract, 1, 2),
                '*' => (Operator::Multiply, 3, 4),
                '/' => (Operator::Divide, 3, 4),
                '^' => (Operator::Power, 8, 7),
                _ => break,
            };
            if left_power < minimum {
                break;
            }
            let place = self.tokens[self.next].1;
            self.advance();
            let (right, right_height) = self.expression(right_power)?;
            height = self.above(height.max(right_height), place)?;
            left = Expression::Binary(operator, left.into(), right.into());
        }
        self.depth -= 1;
        Ok((left, height))
    }

    /// The height of what is built on a tree of this height.
    fn above(&self, height: usize, place: usize) -> Result<usize> {
        if height >= MAX_HEIGHT {
            let message = format!(
                "more than {MAX_HEIGHT} operations on each other, as in a sum of so many terms; put parts of it in parentheses"
            );
            return Err(error(self.text, place, message));
        }
        Ok(height + 1)
    }

    fn operand(&mut self) -> Result<Tree> {
        match self.peek().clone() {
            Token::Number(value) => {
                self.advance();
                Ok((Expression::Number(value), 1))
            }
            Token::Name(name) => {
                let place = self.tokens[self.next].1;
                self.advance();
                self.name(name, place)
            }
            Token::Symbol('(') => {
                self.advance();
                let inner = self.expression(0)?;
                self.expect(')')?;
                Ok(inner)
            }
            Token::Symbol('-') => {
                self.advance();
                let place = self.tokens[self.next].1;
                let (inner, height) = self.expression(5)?;
                Ok((inner.negated(), self.above(height, place)?))
            }
            Token::Symbol('+') => {
                self.advance();
                self.expression(5)
            }
            _ => Err(self.unexpected("a number, a name or `(`")),
        }
    }

    fn name(&mut self, name: String, place: usize) -> Result<Tree> {
        let function = Function::ALL.iter().copied().find(|f| f.name() == name);
        if *self.peek() != Token::Symbol('(') {
            return match (function, name.as_str()) {
                (Some(_), _) => {
                    Err(error(self.text, place, format!("`{name}` is a function: write its arguments in parentheses")))
                }
                (None, "pi") => Ok((Expression::Pi, 1)),
                (None, "t") => Ok((Expression::Time, 1)),
                (None, _) => Ok((Expression::Variable(name), 1)),
            };
        }
        let Some(function) = function else {
            let known: Vec<&str> = Function::ALL.iter().map(|f| f.name()).collect();
            return Err(error(self.text, place, format!("function `{name}` is unknown; known: {}", known.join(", "))));
        };
        self.advance();
        let (first, mut height) = self.expression(0)?;
        let mut arguments = vec![first];
        while *self.peek() == Token::Symbol(',') {
            self.advance();
            let (next, next_height) = self.expression(0)?;
            arguments.push(next);
            height = height.max(next_height);
        }
        self.expect(')')?;
        if arguments.len() != function.arity() {
            let message = format!("`{name}` takes {} argument(s), found {}", function.arity(), arguments.len());
            return Err(error(self.text, place, message));
        }
        Ok((Expression::Call(function, arguments), self.above(height, place)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(source: &str) -> String {
        parse(source).unwrap().to_string()
    }

    #[test]
    fn precedence_follows_mathematics() {
        assert_eq!(parse("-x^2").unwrap(), parse("-(x^2)").unwrap());
        assert_eq!(parse("2^3^2").unwrap(), parse("2^(3^2)").unwrap());
        assert_eq!(parse("a - b - c").unwrap(), parse("(a - b) - c").unwrap());
        assert_eq!(parse("a/b*c").unwrap(), parse("(a/b)*c").unwrap());
        assert_eq!(parse("2^-x").unwrap(), parse("2^(-x)").unwrap());
        assert_eq!(parse("x**2").unwrap(), parse("x^2").unwrap());
    }

    #[test]
    fn what_is_printed_reads_back() {
        for source in
            ["1e-3*x + sin(2*pi*t)", "-(a + b)/(c - (d - e))", "clamp(u, -1, 1)^2", "delay(u, 0.12)", "(-x)^2", "a*-b"]
        {
            let once = parse(source).unwrap();
            assert_eq!(parse(&once.to_string()).unwrap(), once, "{source} -> {once}");
        }
        assert_eq!(text("a - (b - c)"), "a - (b - c)");
    }

    #[test]
    fn errors_name_the_place() {
        for (source, position, words) in [
            ("k*x +", 6, "found the end"),
            ("foo(x)", 1, "unknown"),
            ("sin x", 1, "parentheses"),
            ("clamp(u, 1)", 1, "takes 3"),
            ("a $ b", 3, "not part"),
            ("(a", 3, "`)`"),
            ("a b", 3, "operator"),
            ("1.2.3", 1, "not a number"),
        ] {
            match parse(source) {
                Err(Error::Parse { position: found, message, .. }) => {
                    assert_eq!(found, position, "{source}: {message}");
                    assert!(message.contains(words), "{source}: {message}");
                }
                other => panic!("{source}: {other:?}"),
            }
        }
    }

    #[test]
    fn deep_nesting_is_an_error_and_no_overflow() {
        let source = format!("{}x{}", "(".repeat(10_000), ")".repeat(10_000));
        assert!(parse(&source).is_err());
        assert!(parse(&"-".repeat(10_000)).is_err());
    }

    /// On the stack that a thread has by default: whoever reads it walks it too.
    #[test]
    fn a_sum_or_product_of_too_many_parts_is_one_short_line() {
        for operator in ["+", "-", "*", "/"] {
            let source = vec!["x"; 20_000].join(operator);
            let error = parse(&source).unwrap_err().to_string();
            assert!(error.contains("more than 1000 operations on each other"), "{error}");
            assert!(error.chars().count() < 300 && error.contains("at character 2000"), "{error}");
            let longest = parse(&vec!["x"; 1000].join(operator)).unwrap();
            assert_eq!(parse(&longest.to_string()).unwrap(), longest);
            longest.derivative("x").unwrap();
        }
        // A tree of the same parts that is less high.
        let sum = format!("({})", vec!["x"; 900].join("+"));
        parse(&vec![sum; 20].join("+")).unwrap();
        let nested = (0..150).fold("x".to_string(), |inner, _| format!("({inner}+x+x+x+x+x+x+x)"));
        assert!(parse(&nested).unwrap_err().to_string().contains("operations on each other"));
    }
}
