//! The manifest of a run: its files with their sizes and checksums, so that a copy of the folder can be checked.
//!
//! ```text
//! jq -r '.files[] | "\(.sha256)  \(.file)"' manifest.json | sha256sum --check
//! ```
//!
//! The checksum is SHA-256 (FIPS 180-4), which every system has a program for; [`crate::job::Fingerprint`] is for rubor alone.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{Failure, Outcome};
use crate::{output, writers};

/// Name of the manifest in the folder of a run.
pub const MANIFEST_FILE: &str = "manifest.json";

/// Files of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[schemars(title = "rubor manifest")]
pub struct Manifest {
    /// Version of rubor that wrote it.
    pub rubor: String,
    /// Every result in the folder by its name, but the manifest itself.
    pub files: Vec<Entry>,
}

/// A file of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Entry {
    /// Its name.
    pub file: String,
    /// Its length.
    pub bytes: u64,
    /// SHA-256 of its bytes: 64 hexadecimal digits.
    pub sha256: String,
}

impl Manifest {
    /// JSON schema of the file.
    pub fn json_schema_value() -> serde_json::Value {
        schemars::schema_for!(Self).to_value()
    }

    /// Reads all files of a folder that `is_listed` names.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(crate) fn of(folder: &Path, is_listed: impl Fn(&str) -> bool) -> Outcome<Self> {
        let entries = std::fs::read_dir(folder).map_err(|e| Failure::read(folder, e))?;
        let mut names: Vec<String> = entries
            .filter_map(|e| Some(e.ok()?.file_name().to_str()?.to_owned()))
            .filter(|name| name != MANIFEST_FILE && is_listed(name))
            .collect();
        names.sort();
        let mut files = Vec::with_capacity(names.len());
        writers::beside(&|name: String| entry(folder, name), &mut |entry| files.push(entry), |push| {
            names.into_iter().try_for_each(push)
        })?;
        files.sort_by(|a: &Entry, b| a.file.cmp(&b.file));
        Ok(Self { rubor: env!("CARGO_PKG_VERSION").to_owned(), files })
    }

    /// Writes it into the folder.
    ///
    /// # Errors
    /// The system reports an error.
    pub(crate) fn write(&self, folder: &Path) -> Outcome {
        output::write_json(&folder.join(MANIFEST_FILE), self)
    }
}

fn entry(folder: &Path, file: String) -> Outcome<Entry> {
    let path = folder.join(&file);
    let wrong = |e: std::io::Error| Failure::read(&path, e);
    let mut from = File::open(&path).map_err(wrong)?;
    let mut hash = Sha256::default();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match from.read(&mut buffer).map_err(wrong)? {
            0 => break,
            n => hash.update(&buffer[..n]),
        }
    }
    let bytes = hash.length;
    Ok(Entry { file, bytes, sha256: hash.finish() })
}

/// SHA-256 (FIPS 180-4, section 6.2). Checked against the examples of the standard; nothing here is secret.
struct Sha256 {
    state: [u32; 8],
    block: [u8; 64],
    /// Bytes so far.
    length: u64,
}

/// Fractional parts of the cube roots of the first 64 primes (FIPS 180-4, section 4.2.2).
const K: [u32; 64] = [
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2,
];

impl Default for Sha256 {
    fn default() -> Self {
        // Fractional parts of the square roots of the first eight primes (section 5.3.3).
        let state =
            [0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19];
        Self { state, block: [0; 64], length: 0 }
    }
}

impl Sha256 {
    fn update(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let at = (self.length % 64) as usize;
            let n = bytes.len().min(64 - at);
            self.block[at..at + n].copy_from_slice(&bytes[..n]);
            self.length += n as u64;
            bytes = &bytes[n..];
            if at + n == 64 {
                self.compress();
            }
        }
    }

    /// Section 6.2.2.
    fn compress(&mut self) {
        let mut w = [0u32; 64];
        for (word, bytes) in w.iter_mut().zip(self.block.chunks_exact(4)) {
            *word = u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
        }
        for t in 16..64 {
            let s0 = w[t - 15].rotate_right(7) ^ w[t - 15].rotate_right(18) ^ (w[t - 15] >> 3);
            let s1 = w[t - 2].rotate_right(17) ^ w[t - 2].rotate_right(19) ^ (w[t - 2] >> 10);
            w[t] = w[t - 16].wrapping_add(s0).wrapping_add(w[t - 7]).wrapping_add(s1);
        }
        let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = self.state;
        for t in 0..64 {
            let sum1 = e.rotate_right(6) ^ e.rotate_right(11) ^ e.rotate_right(25);
            let choice = (e & f) ^ (!e & g);
            let first = h.wrapping_add(sum1).wrapping_add(choice).wrapping_add(K[t]).wrapping_add(w[t]);
            let sum0 = a.rotate_right(2) ^ a.rotate_right(13) ^ a.rotate_right(22);
            let majority = (a & b) ^ (a & c) ^ (b & c);
            (h, g, f, e) = (g, f, e, d.wrapping_add(first));
            (d, c, b, a) = (c, b, a, first.wrapping_add(sum0.wrapping_add(majority)));
        }
        for (sum, value) in self.state.iter_mut().zip([a, b, c, d, e, f, g, h]) {
            *sum = sum.wrapping_add(value);
        }
    }

    fn finish(mut self) -> String {
        let bits = 8 * self.length;
        self.update(&[0x80]);
        while self.length % 64 != 56 {
            self.update(&[0]);
        }
        self.update(&bits.to_be_bytes());
        self.state.iter().map(|word| format!("{word:08x}")).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sha256(bytes: &[u8]) -> String {
        let mut hash = Sha256::default();
        // In pieces of many lengths.
        let mut rest = bytes;
        let mut n = 1;
        while !rest.is_empty() {
            let (piece, more) = rest.split_at(rest.len().min(n));
            hash.update(piece);
            (rest, n) = (more, n * 3 % 101 + 1);
        }
        hash.finish()
    }

    #[test]
    fn checksums_are_those_of_the_standard() {
        // NIST, "Descriptions of SHA-256": the empty text, one block, two blocks, a million times a.
        let examples: [(&[u8], &str); 4] = [
            (b"", "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"),
            (b"abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"),
            (
                b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
                "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1",
            ),
            (&vec![b'a'; 1_000_000], "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0"),
        ];
        for (text, expected) in examples {
            assert_eq!(sha256(text), expected);
        }
    }

    #[test]
    fn a_manifest_lists_what_it_is_asked_for_but_itself() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [("b.png", "abc"), ("a.png", ""), ("c.txt", "x"), (MANIFEST_FILE, "old")] {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let manifest = Manifest::of(folder.path(), |name| name != "c.txt").unwrap();
        manifest.write(folder.path()).unwrap();
        let text = std::fs::read_to_string(folder.path().join(MANIFEST_FILE)).unwrap();
        assert_eq!(serde_json::from_str::<Manifest>(&text).unwrap(), manifest);
        let files: Vec<_> = manifest.files.iter().map(|f| (&f.file[..], f.bytes, &f.sha256[..4])).collect();
        assert_eq!(files, [("a.png", 0, "e3b0"), ("b.png", 3, "ba78")]);
    }
}
