//! Reads expressions: operator precedence by binding powers (Pratt 1973, Top down operator precedence).

use super::{Expression, Function, Operator};
use crate::error::{Error, Result};

/// Deeper nesting than any formula has; guards the stack against hostile input.
const MAX_DEPTH: usize = 200;

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
    let expression = parser.expression(0)?;
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
    fn expression(&mut self, minimum: u8) -> Result<Expression> {
        self.depth += 1;
        if self.depth > MAX_DEPTH {
            return Err(error(self.text, self.tokens[self.next].1, format!("nested deeper than {MAX_DEPTH}")));
        }
        let mut left = self.operand()?;
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
            self.advance();
            let right = self.expression(right_power)?;
            left = Expression::Binary(operator, left.into(), right.into());
        }
        self.depth -= 1;
        Ok(left)
    }

    fn operand(&mut self) -> Result<Expression> {
        match self.peek().clone() {
            Token::Number(value) => {
                self.advance();
                Ok(Expression::Number(value))
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
                Ok(self.expression(5)?.negated())
            }
            Token::Symbol('+') => {
                self.advance();
                self.expression(5)
            }
            _ => Err(self.unexpected("a number, a name or `(`")),
        }
    }

    fn name(&mut self, name: String, place: usize) -> Result<Expression> {
        let function = Function::ALL.iter().copied().find(|f| f.name() == name);
        if *self.peek() != Token::Symbol('(') {
            return match (function, name.as_str()) {
                (Some(_), _) => {
                    Err(error(self.text, place, format!("`{name}` is a function: write its arguments in parentheses")))
                }
                (None, "pi") => Ok(Expression::Pi),
                (None, "t") => Ok(Expression::Time),
                (None, _) => Ok(Expression::Variable(name)),
            };
        }
        let Some(function) = function else {
            let known: Vec<&str> = Function::ALL.iter().map(|f| f.name()).collect();
            return Err(error(self.text, place, format!("function `{name}` is unknown; known: {}", known.join(", "))));
        };
        self.advance();
        let mut arguments = vec![self.expression(0)?];
        while *self.peek() == Token::Symbol(',') {
            self.advance();
            arguments.push(self.expression(0)?);
        }
        self.expect(')')?;
        if arguments.len() != function.arity() {
            let message = format!("`{name}` takes {} argument(s), found {}", function.arity(), arguments.len());
            return Err(error(self.text, place, message));
        }
        Ok(Expression::Call(function, arguments))
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
}
