//! Edited archives, model descriptions and library files, given to `validate` and to what opens an FMU for
//! `run`. None of their code is executed.

use std::io::{Cursor, Write};

use punctual_cosim::host::{Fmu, PLATFORM};
use punctual_cosim::validate::{Severity, validate};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::bytes::Bytes;
use crate::campaign;
use crate::misbehaving::{description, library};

const WORDS: &[&str] = &[
    "<ScalarVariable name=\"a\" valueReference=\"1\"><Real/></ScalarVariable>",
    "<Unknown index=\"1\" dependencies=\"\"/>",
    "<!-- -->",
    "<![CDATA[",
    "]]>",
    "<?xml version=\"1.0\"?>",
    "<!DOCTYPE a [<!ENTITY b 'c'>]>",
    "&amp;",
    "&#0;",
    "&#xFFFFFFFF;",
    "&b;",
    "xmlns:a=\"b\"",
    "</ModelVariables>",
    "<ModelVariables>",
    "dependencies=\"1 2 3\"",
    "dependenciesKind=\"fixed\"",
    "valueReference=\"4294967295\"",
    "start=\"1e999\"",
    "min=\"NaN\"",
    "INF",
    "true",
    "fixed",
    "output",
    "calculatedParameter",
    "../../etc/x",
    "C:",
    "a\\b",
    "%s%n",
    "\u{fc}\u{1F600}",
    "\u{feff}",
    "PK\u{1}\u{2}",
    "PK\u{3}\u{4}",
    "PK\u{5}\u{6}",
    "\u{0}\u{0}\u{0}\u{0}",
];

const NAMES: &[&str] = &[
    "modelDescription.xml",
    "modeldescription.xml",
    "resources/a",
    "resources/",
    "../escape",
    "/escape",
    "a\\b",
    "C:/x",
    "resources",
    "binaries/linux64/x.so",
    "binaries/",
    "sources/a.c",
    "documentation/index.html",
    "\u{fc}/\u{1F600}",
    "CON",
    "a/./b",
    "a//b",
    "%s%n",
    "extra/\n\t",
];

fn pack(entries: &[(&str, &[u8])], method: CompressionMethod) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        // Duplicate names are left out here, since edits of the finished archive produce them.
        if zip.start_file(*name, SimpleFileOptions::default().compression_method(method)).is_ok() {
            zip.write_all(bytes).expect("memory");
        }
    }
    zip.finish().expect("an archive").into_inner()
}

#[test]
fn archives_with_edits() {
    let (xml, library) = (description("none", &[]), library(&[]));
    let place = format!("binaries/{PLATFORM}/misbehaving{}", std::env::consts::DLL_SUFFIX);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("x.fmu");
    campaign::run("archives", 200, "opened", |bytes| {
        let mut bytes = Bytes::new(bytes);
        let method = bytes.pick(&[CompressionMethod::Stored, CompressionMethod::Deflated]);
        let (mut xml, mut library) = (xml.clone().into_bytes(), library.clone());
        let mut extra = None;
        let kind = bytes.below(8);
        match kind {
            0..3 => xml = bytes.edited(&xml, WORDS),
            3 | 4 => library = bytes.edited(&library, WORDS),
            5 => extra = Some(bytes.pick(NAMES)),
            _ => {}
        }
        let mut entries = vec![("modelDescription.xml", &xml[..]), (&place, &library)];
        entries.extend(extra.map(|name| (name, &b"extra"[..])));
        let mut archive = pack(&entries, method);
        if kind > 5 {
            // Most of an archive is content; the relevant parts are its end and the headers of entries.
            let at = archive.len() - 300 - bytes.below(200);
            let tail = archive.split_off(at);
            archive.extend(bytes.edited(&tail, WORDS));
            if kind == 7 {
                let head = bytes.edited(&archive[..100], WORDS);
                archive.splice(..100, head);
            }
        }
        std::fs::write(&path, archive).expect("a writable folder");
        let report = match validate(&path, None) {
            Ok(report) => report,
            Err(refusal) => {
                // Another version is out of scope, and nothing else is reported.
                assert!(refusal.to_string().contains("x.fmu: it is of FMI "), "{refusal}");
                return 0;
            }
        };
        let errors = report.count(Severity::Error);
        assert!(report.findings.iter().all(|f| !f.to_string().is_empty()));
        match Fmu::open(&path) {
            Ok(fmu) => {
                assert!(!fmu.description().model_name.is_empty() || errors > 0);
                1
            }
            Err(refusal) => {
                let refusal = refusal.to_string();
                assert!(
                    refusal.contains("x.fmu: ") && errors > 0,
                    "run refuses, validate does not: {refusal}"
                );
                0
            }
        }
    });
    let left: Vec<_> = std::fs::read_dir(folder.path()).expect("the folder").collect();
    assert_eq!(left.len(), 1, "{left:?}");
}
