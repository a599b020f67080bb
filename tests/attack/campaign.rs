//! Runs cases: first those of the corpus, then generated ones.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{Seek, Write};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

/// The longest time of a case on a loaded machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// The most bytes of a generated case.
const LONGEST: usize = 256;

/// The splitmix64 generator: the bytes of a case depend only on its number.
fn generated(case: usize) -> Vec<u8> {
    let mut state = case as u64;
    let mut next = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    };
    let length = 1 + next() as usize % LONGEST;
    (0..length.div_ceil(8)).flat_map(|_| next().to_le_bytes()).take(length).collect()
}

/// The cases of `corpus/NAME.txt`: hexadecimal digits, one case per line, with a remark after `#`.
fn corpus(name: &str) -> Vec<Vec<u8>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/attack/corpus").join(format!("{name}.txt"));
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    lines.filter(|line| !line.is_empty()).map(|line| bytes(line, name)).collect()
}

fn bytes(hex: &str, name: &str) -> Vec<u8> {
    let pairs = hex.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).expect("ASCII"));
    let read = |pair| u8::from_str_radix(pair, 16).unwrap_or_else(|e| panic!("corpus {name}: {pair}: {e}"));
    pairs.map(read).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").expect("memory");
        text
    })
}

/// Passes every case of the corpus and half of `usual` generated ones (or `usual` times `PUNCTUAL_ATTACK`) to `attack`. Prints
/// their number, and the sum of the numbers that `attack` returns, as `counted`. A case that fails is printed
/// as a line for the corpus. A case that ends the process is left in a file beside the tests.
pub(crate) fn run(name: &str, usual: usize, counted: &str, mut attack: impl FnMut(&[u8]) -> usize) {
    let factor: Option<usize> =
        std::env::var("PUNCTUAL_ATTACK").ok().map(|n| n.parse().expect("PUNCTUAL_ATTACK: a number"));
    let generate = factor.map_or(usual / 2, |factor| usual * factor);
    let last = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("attack-{name}"));
    let mut last = File::create(last).expect("a file beside the tests");
    let (begin, kept) = (Instant::now(), corpus(name));
    let (cases, mut sum) = (kept.len() + generate, 0);
    for case in kept.into_iter().chain((0..generate).map(generated)) {
        last.rewind().expect("a file");
        writeln!(last, "{}", hex(&case)).expect("a file");
        let started = Instant::now();
        match catch_unwind(AssertUnwindSafe(|| attack(&case))) {
            Ok(count) => sum += count,
            Err(panic) => {
                println!("for tests/attack/corpus/{name}.txt:\n{}", hex(&case));
                resume_unwind(panic);
            }
        }
        assert!(started.elapsed() < PATIENCE, "{name}: {} took {:?}", hex(&case), started.elapsed());
    }
    println!("{name}: {cases} cases, {sum} {counted}, {:.1} s", begin.elapsed().as_secs_f64());
}
