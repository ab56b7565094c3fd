//! The code page of a scene: Maya writes names in that of its machine and says which in the header
//! (`//Codeset: 932`).

use std::borrow::Cow;

use encoding_rs::{Encoding, UTF_8, WINDOWS_1252};

use crate::notes::Notes;

/// Number of bytes in which the header is searched.
const HEADER_BYTES: usize = 4096;

/// The scene as UTF-8. Scenes that are in plain ASCII or UTF-8 are not copied.
pub(super) fn to_utf8<'a>(bytes: &'a [u8], notes: &mut Notes) -> Cow<'a, [u8]> {
    if let Some((encoding, length)) = Encoding::for_bom(bytes) {
        return if encoding == UTF_8 {
            utf8_or_western(&bytes[length..], "the byte order mark says UTF-8", notes)
        } else {
            decoded(encoding, &bytes[length..]).unwrap_or(Cow::Borrowed(bytes))
        };
    }
    if bytes.is_ascii() {
        return Cow::Borrowed(bytes);
    }
    let Some(label) = label(&bytes[..bytes.len().min(HEADER_BYTES)]) else {
        return utf8_or_western(bytes, "the header names no codeset", notes);
    };
    let said = format!("the header says codeset {label}");
    match encoding(&label) {
        Some(encoding) if encoding == UTF_8 => utf8_or_western(bytes, &said, notes),
        Some(encoding) => decoded(encoding, bytes).unwrap_or_else(|| {
            notes.say(format!("{said}, and its names are not: they are read as UTF-8 or code page 1252"));
            utf8_or_western(bytes, &said, &mut Notes::default())
        }),
        None => {
            notes.say(format!("{said}, which is not known: its names are read as UTF-8 or code page 1252"));
            utf8_or_western(bytes, &said, &mut Notes::default())
        }
    }
}

/// Code page 1252 has a letter for every byte, so names that differ stay different even if the guess is wrong.
fn utf8_or_western<'a>(bytes: &'a [u8], said: &str, notes: &mut Notes) -> Cow<'a, [u8]> {
    if std::str::from_utf8(bytes).is_ok() {
        return Cow::Borrowed(bytes);
    }
    notes.say(format!("{said}, and its names are no UTF-8: they are read in code page 1252"));
    match WINDOWS_1252.decode_without_bom_handling(bytes).0 {
        Cow::Borrowed(text) => Cow::Borrowed(text.as_bytes()),
        Cow::Owned(text) => Cow::Owned(text.into_bytes()),
    }
}

/// None if the bytes are not in this encoding.
fn decoded<'a>(encoding: &'static Encoding, bytes: &'a [u8]) -> Option<Cow<'a, [u8]>> {
    let text = encoding.decode_without_bom_handling_and_without_replacement(bytes)?;
    Some(match text {
        Cow::Borrowed(text) => Cow::Borrowed(text.as_bytes()),
        Cow::Owned(text) => Cow::Owned(text.into_bytes()),
    })
}

/// What `//Codeset: 932` or `fileInfo "codeset" "932";` says.
fn label(header: &[u8]) -> Option<String> {
    for line in header.split(|b| *b == b'\n') {
        let line = String::from_utf8_lossy(line).to_lowercase();
        let line = line.trim();
        let value = match line.strip_prefix("//") {
            Some(comment) => comment.trim_start().strip_prefix("codeset:"),
            None => line
                .strip_prefix("fileinfo")
                .and_then(|rest| rest.trim_start().strip_prefix("\"codeset\""))
                .map(|rest| rest.trim_end_matches(';')),
        };
        if let Some(value) = value {
            return Some(value.trim().trim_matches('"').to_owned());
        }
    }
    None
}

/// Windows writes the number of the code page, other systems the name of the locale's codeset.
fn encoding(label: &str) -> Option<&'static Encoding> {
    let number = label.trim_start_matches("cp").trim_start_matches("windows-").trim_start_matches("ibm");
    let name = match number {
        "932" | "943" | "sjis" => "shift_jis",
        "936" | "1386" => "gbk",
        "54936" => "gb18030",
        "949" | "51949" | "euckr" => "euc-kr",
        "950" => "big5",
        "20932" | "51932" | "eucjp" => "euc-jp",
        "874" => "windows-874",
        "866" => "ibm866",
        "10000" | "macroman" => "macintosh",
        "10007" => "x-mac-cyrillic",
        "20866" => "koi8-r",
        "21866" => "koi8-u",
        "65001" | "utf8" => "utf-8",
        "20127" | "646" | "c" | "posix" => "us-ascii",
        n if n.len() == 4 && n.starts_with("125") => {
            return Encoding::for_label_no_replacement(format!("windows-{n}").as_bytes());
        }
        n if n.parse::<u32>().is_ok_and(|n| (28_591..=28_606).contains(&n)) => {
            let part = n.parse::<u32>().ok()? - 28_590;
            return Encoding::for_label_no_replacement(format!("iso-8859-{part}").as_bytes());
        }
        _ => label,
    };
    Encoding::for_label_no_replacement(name.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(header: &str, name: &[u8]) -> (String, Vec<String>) {
        let mut notes = Notes::default();
        let bytes = [header.as_bytes(), b"\ncreateNode transform -n \"", name, b"\";\n"].concat();
        let text = String::from_utf8(to_utf8(&bytes, &mut notes).into_owned()).unwrap();
        let name = text.split('"').rev().nth(1).unwrap().to_owned();
        (name, notes.lines())
    }

    #[test]
    fn names_are_read_in_the_code_page_of_the_header() {
        let cases: [(&str, &[u8], &str); 13] = [
            ("//Codeset: 1252", b"Z\xe4hne", "Zähne"),
            ("//Codeset: 932", b"\x8d\xb6\x96\xda", "左目"),
            // The second byte of this letter is a backslash.
            ("//Codeset: 932", b"\x95\x5cShape", "表Shape"),
            ("//Codeset: 936", b"\xd7\xf3", "左"),
            ("//Codeset: 949", b"\xbf\xde", "왼"),
            ("//Codeset: 950", b"\xa5\xaa", "左"),
            ("//Codeset: 1251", b"\xeb", "л"),
            ("//Codeset: 1250", b"\xea", "ę"),
            ("//Codeset: eucJP", b"\xba\xb8", "左"),
            ("//Codeset: UTF-8", "顔".as_bytes(), "顔"),
            ("//Codeset: 65001", "顔".as_bytes(), "顔"),
            ("//Codeset: ISO-8859-1", b"\xfc", "ü"),
            ("fileInfo \"codeset\" \"28605\";", b"\xa4", "€"),
        ];
        for (header, bytes, expected) in cases {
            let (name, notes) = read(header, bytes);
            assert_eq!(name, expected, "{header}");
            // 28605 is ISO-8859-15, whose euro sign shows that it was not taken for ISO-8859-1.
            assert!(notes.is_empty(), "{header}: {notes:?}");
        }
    }

    #[test]
    fn a_missing_wrong_or_unknown_code_page_is_said() {
        for (header, bytes, expected, said) in [
            ("//Maya ASCII 2020 scene", &b"Z\xe4hne"[..], "Zähne", "no codeset"),
            ("//Codeset: UTF-8", b"Z\xe4hne", "Zähne", "no UTF-8"),
            ("//Codeset: 932", b"\x81\xff", "\u{81}ÿ", "are not"),
            ("//Codeset: klingon", "顔".as_bytes(), "顔", "not known"),
        ] {
            let (name, notes) = read(header, bytes);
            assert_eq!(name, expected, "{header}");
            assert!(notes.len() == 1 && notes[0].contains(said), "{header}: {notes:?}");
        }
        let (name, notes) = read("//Maya ASCII 2020 scene", "顔".as_bytes());
        assert!(name == "顔" && notes.is_empty(), "{notes:?}");
    }

    #[test]
    fn byte_order_marks_are_taken_off() {
        let wide: Vec<u8> =
            "\u{feff}createNode transform;".encode_utf16().flat_map(u16::to_le_bytes).collect();
        for bytes in ["\u{feff}createNode transform;".as_bytes(), &wide] {
            assert_eq!(&*to_utf8(bytes, &mut Notes::default()), b"createNode transform;");
        }
    }
}
