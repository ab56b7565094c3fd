//! Words, strings and signs of a Maya ASCII scene, one at a time: a statement of a million numbers is never held as
//! tokens.

use std::borrow::Cow;

use crate::error::Fault;

/// One word of the text.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Token<'a> {
    /// Command, flag or number.
    Word(&'a [u8]),
    /// Text in double quotes, escapes resolved; bytes that are not UTF-8 (old scenes are in the code page of their
    /// machine) become the replacement character.
    Text(Cow<'a, str>),
    /// `;`
    End,
}

pub(crate) struct Lexer<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Line of the next byte, from 1.
    line: usize,
}

impl<'a> Lexer<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 1 }
    }

    pub(crate) fn line(&self) -> usize {
        self.line
    }

    /// The next token; none at the end of the text.
    pub(crate) fn next(&mut self) -> Result<Option<Token<'a>>, Fault> {
        self.skip_space()?;
        let Some(first) = self.bytes.get(self.at) else { return Ok(None) };
        match first {
            b';' => {
                self.at += 1;
                Ok(Some(Token::End))
            }
            b'"' => self.text().map(Some),
            _ => {
                let start = self.at;
                // Braces and commas only separate: `{"jawOpen","weight[0]"}`.
                while let Some(b) = self.bytes.get(self.at)
                    && !matches!(b, b' ' | b'\t' | b'\r' | b'\n' | b';' | b'"' | b',' | b'{' | b'}')
                {
                    self.at += 1;
                }
                Ok(Some(Token::Word(&self.bytes[start..self.at])))
            }
        }
    }

    /// Like [`Lexer::next`], but leaves the `;` or the end of the text where it is and returns none there.
    pub(crate) fn argument(&mut self) -> Result<Option<Token<'a>>, Fault> {
        self.skip_space()?;
        match self.bytes.get(self.at) {
            None | Some(b';') => Ok(None),
            Some(_) => self.next(),
        }
    }

    /// Goes behind `-type "x"` if that comes next.
    pub(crate) fn skip_type(&mut self) -> Result<(), Fault> {
        self.skip_space()?;
        if self.bytes[self.at..].starts_with(b"-type") {
            self.argument()?;
            self.argument()?;
        }
        Ok(())
    }

    /// True if the statement has no further argument.
    pub(crate) fn at_end(&mut self) -> Result<bool, Fault> {
        self.skip_space()?;
        Ok(matches!(self.bytes.get(self.at), None | Some(b';')))
    }

    /// Goes behind the next `;`.
    pub(crate) fn skip_statement(&mut self) -> Result<(), Fault> {
        while let Some(token) = self.next()? {
            if token == Token::End {
                return Ok(());
            }
        }
        Ok(())
    }

    fn skip_space(&mut self) -> Result<(), Fault> {
        while let Some(b) = self.bytes.get(self.at) {
            match b {
                b'\n' => {
                    self.line += 1;
                    self.at += 1;
                }
                b' ' | b'\t' | b'\r' | b',' | b'{' | b'}' => self.at += 1,
                b'/' if self.bytes.get(self.at + 1) == Some(&b'/') => {
                    let rest = &self.bytes[self.at..];
                    self.at += rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
                }
                b'/' if self.bytes.get(self.at + 1) == Some(&b'*') => {
                    let rest = &self.bytes[self.at..];
                    let Some(length) = rest.windows(2).skip(2).position(|w| w == b"*/") else {
                        return Err(Fault::new(self.line, "a comment without an end", "*/"));
                    };
                    let end = self.at + length + 4;
                    self.line += self.bytes[self.at..end].iter().filter(|b| **b == b'\n').count();
                    self.at = end;
                }
                _ => break,
            }
        }
        Ok(())
    }

    fn text(&mut self) -> Result<Token<'a>, Fault> {
        let opened = self.line;
        let start = self.at + 1;
        let mut at = start;
        let mut escaped = false;
        loop {
            match self.bytes.get(at) {
                None => return Err(Fault::new(opened, "a text without an end", "a closing \"")),
                Some(b'"') => break,
                Some(b'\\') => {
                    escaped = true;
                    at += 2;
                }
                Some(b) => {
                    self.line += usize::from(*b == b'\n');
                    at += 1;
                }
            }
        }
        let raw = String::from_utf8_lossy(&self.bytes[start..at]);
        self.at = at + 1;
        Ok(Token::Text(if escaped { Cow::Owned(unescape(&raw)) } else { raw }))
    }
}

fn unescape(raw: &str) -> String {
    let mut out = String::with_capacity(raw.len());
    let mut chars = raw.chars();
    while let Some(c) = chars.next() {
        match c {
            '\\' => match chars.next() {
                Some('n') => out.push('\n'),
                Some('t') => out.push('\t'),
                Some('r') => out.push('\r'),
                Some(other) => out.push(other),
                None => {}
            },
            c => out.push(c),
        }
    }
    out
}

/// Writes a text so that [`Lexer`] and Maya read it back.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            '\r' => out.push_str("\\r"),
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<String> {
        let mut lexer = Lexer::new(text.as_bytes());
        let mut out = Vec::new();
        while let Some(token) = lexer.next().unwrap() {
            out.push(match token {
                Token::Word(w) => String::from_utf8_lossy(w).into_owned(),
                Token::Text(t) => format!("<{t}>"),
                Token::End => ";".into(),
            });
        }
        out
    }

    #[test]
    fn words_texts_comments_and_lines() {
        let text =
            "//a \"comment\"\nsetAttr -s 2 \".vt[0:1]\" 1.5 -2e-3;/* more\n; */ x {\"a b\",\"c\\\"d\\n\"};";
        assert_eq!(
            words(text),
            ["setAttr", "-s", "2", "<.vt[0:1]>", "1.5", "-2e-3", ";", "x", "<a b>", "<c\"d\n>", ";"]
        );
        let mut lexer = Lexer::new(b"a\n\n\"two\nlines\" b");
        lexer.next().unwrap();
        lexer.next().unwrap();
        assert_eq!(lexer.line(), 4);
        for (wrong, line) in [("a;\n\"open", 2), ("a;\n\n/* open", 3), ("\"a\\", 1)] {
            let mut lexer = Lexer::new(wrong.as_bytes());
            let fault = loop {
                match lexer.next() {
                    Ok(Some(_)) => {}
                    Ok(None) => panic!("{wrong}"),
                    Err(fault) => break fault,
                }
            };
            assert_eq!(fault.line, line);
        }
    }

    #[test]
    fn quoted_texts_come_back() {
        for text in ["", "plain", "a\"b\\c\nd\te", "é ü 顔"] {
            let written = quoted(text);
            assert_eq!(Lexer::new(written.as_bytes()).next().unwrap(), Some(Token::Text(text.into())));
        }
    }
}
