//! Maya ASCII as text: words, statements, nodes.

mod code_page;
pub(crate) mod lexer;
pub(crate) mod parser;
pub(crate) mod scene;
pub(crate) mod words;
