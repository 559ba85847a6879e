//! Networks in ONNX files: their output beside that of ONNX Runtime, and those that cannot be used; by each backend.
//!
//! Networks are made by `python/onnx_models.py` with random weights; `rooms` is the one that comes with the laboratory.

use std::fs;
use std::path::Path;

use lattice_lab::models::write_rooms;
use lattice_nodes::segmenter::{Backend, Scores, Size, Values, read_network, read_network_by};
use lattice_test::python::{python, script};
use serde_json::Value;

fn run(python: &Path, name: &str, arguments: &[&str]) -> Value {
    let output = std::process::Command::new(python)
        .arg(script(name))
        .args(arguments)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{name}: {errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Backends that can be tested: ONNX Runtime with the feature and a library alone.
fn backends() -> Vec<(&'static str, Backend)> {
    let has_library = std::env::var_os("ORT_DYLIB_PATH").is_some();
    let ort = cfg!(feature = "ort") && has_library;
    if !ort {
        println!("skipped for ort: no feature `ort`, or no library in ORT_DYLIB_PATH");
    }
    let all = Backend::ALL.into_iter();
    all.filter(|(_, backend)| *backend == Backend::Tract || ort)
        .collect()
}

fn numbers<const N: usize, T>(path: &Path, from_bytes: fn([u8; N]) -> T) -> Vec<T> {
    let bytes = fs::read(path).unwrap();
    let (numbers, rest) = bytes.as_chunks::<N>();
    assert!(rest.is_empty());
    numbers.iter().map(|bytes| from_bytes(*bytes)).collect()
}

/// Class of each pixel.
fn classes(scores: &Scores) -> Vec<i64> {
    let pixels = scores.size.pixels();
    match &scores.values {
        Values::Classes(classes) => classes.clone(),
        Values::Scores { classes, values } => (0..pixels)
            .map(|pixel| {
                let of = |class: &usize| values[class * pixels + pixel];
                let best = (0..*classes).max_by(|a, b| of(a).total_cmp(&of(b)));
                best.unwrap() as i64
            })
            .collect(),
    }
}

#[test]
fn networks_give_what_onnx_runtime_gives() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let folder = path.to_str().unwrap();
    run(&python, "onnx_models.py", &[folder]);
    write_rooms(path).unwrap();
    let names = ["psp", "psp_classes", "deeplab", "segformer", "rooms"];
    let peer = run(&python, "onnx_parity.py", &[&[folder][..], &names].concat());
    for name in names {
        let file = path.join(name);
        let image = numbers(&file.with_extension("in"), f32::from_le_bytes);
        let model = file.with_extension("onnx");
        let backends = backends().into_iter();
        for ((backend, by), threads) in backends.flat_map(|by| [(by, 1), (by, 2)]) {
            let network = read_network_by(by, &model, None, threads).unwrap();
            let found = network.run(image.clone()).unwrap();
            let expected = match &found.values {
                Values::Classes(_) => {
                    Values::Classes(numbers(&file.with_extension("out"), i64::from_le_bytes))
                }
                Values::Scores { classes, .. } => Values::Scores {
                    classes: *classes,
                    values: numbers(&file.with_extension("out"), f32::from_le_bytes),
                },
            };
            let difference = match (&found.values, &expected) {
                (Values::Scores { values, .. }, Values::Scores { values: peer, .. }) => {
                    assert_eq!(values.len(), peer.len());
                    let least = peer.iter().copied().fold(f32::MAX, f32::min);
                    let most = peer.iter().copied().fold(f32::MIN, f32::max);
                    let off = values.iter().zip(peer).map(|(a, b)| (a - b).abs());
                    off.fold(0.0, f32::max) / (most - least)
                }
                _ => 0.0,
            };
            let size = found.size;
            let peer_classes = classes(&Scores {
                size,
                values: expected,
            });
            let pairs = classes(&found).into_iter().zip(peer_classes);
            let differ = pairs.filter(|(a, b)| a != b).count();
            println!(
                "{name}, {backend}, {threads} threads: {difference:.1e} of the range from onnxruntime {}, {differ} of {} \
                 pixels differ",
                peer["version"],
                size.pixels()
            );
            assert!(difference < 1e-4, "{name}: {difference}");
            assert!(differ * 1000 <= size.pixels(), "{name}: {differ}");
            network.interrupter()();
            assert!(network.run(image.clone()).is_err(), "{name}, {backend}");
        }
    }
    let psp = read_network(&path.join("psp.onnx"), None, 1).unwrap();
    assert_eq!(psp.names().len(), 12);
    assert_eq!(psp.names()[11], "class 11");
}

#[test]
fn models_that_cannot_be_used_are_refused_by_what_is_wrong() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    run(&python, "onnx_models.py", &[path.to_str().unwrap()]);
    let size = |width, height| Some(Size { width, height });
    for (name, given, expected) in [
        ("nowhere", None, "No such file"),
        ("text", None, "not an ONNX file"),
        ("unknown", None, "Frobnicate"),
        ("huge", None, "tensor 'huge' has the shape [50000, 50000]"),
        ("cut", None, "tensor 'cut' states 100 values and has fewer"),
        (
            "elsewhere",
            None,
            "tensor 'elsewhere' are in an external file",
        ),
        ("made", None, "[100000, 100000]"),
        ("product", None, "[100000, 100000], more than"),
        ("doubled", None, "[524288, 1024], more than"),
        ("spread", None, "[100000, 100000], more than"),
        ("branch", None, "subgraphs are not supported: operator If"),
        ("pair", None, "it has 2 inputs"),
        ("grey", None, "expected f32 of 1 x 3 x rows x columns"),
        ("flat", None, "expected scores of 1 x classes"),
        ("lost", None, "no operator computes the output 'nowhere'"),
        ("named", None, "it has 3 classes and 2 names"),
        ("open", None, "set `input_size`"),
        (
            "psp",
            size(64, 96),
            "its input has 144 pixels, but `input_size` is 64",
        ),
        (
            "open",
            size(1 << 14, 1 << 14),
            "its input has 268435456 pixels",
        ),
    ] {
        let file = path.join(name).with_extension("onnx");
        for (backend, by) in backends() {
            let found = read_network_by(by, &file, given, 1).map(drop);
            let error = found.unwrap_err().to_string();
            assert!(error.contains(expected), "{name}, {backend}: {error}");
            assert!(error.contains(&file.display().to_string()), "{error}");
        }
    }
    for (_, by) in backends() {
        let open = read_network_by(by, &path.join("open.onnx"), size(8, 6), 1).unwrap();
        assert_eq!(open.input().pixels(), 48);
        assert!(open.names().is_empty());
    }
}
