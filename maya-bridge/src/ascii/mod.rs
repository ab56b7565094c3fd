//! Maya ASCII as text: words, statements, nodes.

pub(crate) mod lexer;
pub(crate) mod parser;
pub(crate) mod scene;
pub(crate) mod words;
