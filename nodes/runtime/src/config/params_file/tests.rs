use super::*;
use proptest::prelude::*;

fn read_text(text: &str) -> Result<Vec<FileParam>, ParamFileError> {
    parse(text, Path::new("test.yaml"))
}

fn names(text: &str) -> Vec<String> {
    read_text(text)
        .unwrap()
        .into_iter()
        .map(|param| param.name)
        .collect()
}

#[test]
fn nested_maps_flatten_with_dots() {
    let text = "
mapper:
  ros__parameters:
    rate: 1.0
    qos:
      map: {depth: 7}
      /robot/points: {reliability: reliable}
    empty: {}
    labels: {0: road, true: yes}
    dotted.name: 1
";
    let expected = [
        "rate",
        "qos.map.depth",
        "qos./robot/points.reliability",
        "labels.0",
        "labels.true",
        "dotted.name",
    ];
    assert_eq!(names(text), expected);
    let params = read_text(text).unwrap();
    assert_eq!(params[1].key, "mapper.ros__parameters.qos.map.depth");
    assert_eq!(params[1].value, ParamValue::I64(7));
}

#[test]
fn namespaces_and_wildcards_join_to_patterns() {
    let a = "ros__parameters: {a: 1}";
    for (text, node) in [
        (format!("/**: {{{a}}}"), "/x/y/mapper"),
        (format!("/*: {{{a}}}"), "/mapper"),
        (format!("/**/mapper: {{{a}}}"), "/x/mapper"),
        (format!("/**: {{mapper: {{{a}}}}}"), "/x/mapper"),
        (format!("/x/**/b: {{c/d/**: {{{a}}}}}"), "/x/y/b/c/d/m"),
        (format!("robot: {{mapper: {{{a}}}}}"), "/robot/mapper"),
        (format!("/robot: {{\"*\": {{{a}}}}}"), "/robot/mapper"),
        (format!("/robot/: {{mapper: {{{a}}}}}"), "/robot/mapper"),
        (format!("/: {{mapper: {{{a}}}}}"), "/mapper"),
        (format!("/**: {{{a}, mapper: {{{a}}}}}"), "/x/mapper"),
    ] {
        let params = read_text(&text).unwrap();
        let covered = |param: &FileParam| param.nodes.matches(node);
        assert!(params.iter().all(covered) && !params.is_empty(), "{text}");
    }
}

#[test]
fn empty_files_and_sections_have_no_parameters() {
    let sections = ["m: {ros__parameters: }", "m: {ros__parameters: {}}"];
    for text in ["", "# nothing\n", "---\n", "{}"].iter().chain(&sections) {
        assert_eq!(read_text(text).unwrap(), vec![], "{text}");
    }
}

/// Whole files, or parameters of the node `m`, and what their error says; `;` is a new line.
const WRONG: &str = r#"
    m: 5                          | `m`, a number, ros__parameters
    m: {ros: {a: 1}}              | `m.ros.a`, a number, ros__parameters
    m: [1]                        | `m`, a list, ros__parameters
    [1]                           | ``, a list, a map of nodes
    m:                            | `m`, nothing, ros__parameters
    ros__parameters: {a: 1}       | `ros__parameters`, without a node, a node name
    m p: {ros__parameters: {}}    | `m p.ros__parameters`, characters, a node name
    a//b: {ros__parameters: {}}   | `a//b.ros__parameters`, empty part, a node name
    a: {ros__parameters: };---;b: | more than one document
    = 5                           | `m.ros__parameters`, a number, a map of parameters
    = {a: }                       | `m.ros__parameters.a`, value is missing, ''
    = {a: [1, b]}                 | `m.ros__parameters.a`, an integer, a text
    = {a: [[1]]}                  | `m.ros__parameters.a`, a list in a list, expected
    = {a: [{b: 1}]}               | `m.ros__parameters.a`, a map, expected
    = {a: !x 1}                   | `m.ros__parameters.a`, a tagged value, expected
    = {'': 1}                     | `m.ros__parameters`, an empty text, a name
    = {[1]: 1}                    | `m.ros__parameters`, a list, a name
    = {a.b: 1, a: {b: 2}}         | `m.ros__parameters.a.b`, again, once
    = {a: 1, a: 2}                | duplicate, "a"
    = {a: &x 1}                   | line 1, anchors
    = {a: *x}                     | line 1, anchors
    = {a: 1                       | line, column"#;

#[test]
fn wrong_shapes_say_where_and_what() {
    for row in WRONG.trim().lines() {
        let (text, parts) = row.split_once('|').unwrap();
        let text = match text.trim().strip_prefix('=') {
            Some(params) => format!("m: {{ros__parameters: {params}}}"),
            None => text.trim().replace(';', "\n"),
        };
        let error = read_text(&text).unwrap_err().to_string();
        for part in parts.trim().split(", ").chain(["test.yaml"]) {
            assert!(error.contains(part), "{text}: `{part}` is not in: {error}");
        }
    }
}

#[test]
fn deep_files_are_refused() {
    let deep = |levels: usize| {
        let maps = "{a: ".repeat(levels - 2);
        read_text(&format!(
            "m: {{ros__parameters: {maps}1{}}}",
            "}".repeat(levels - 2)
        ))
    };
    assert_eq!(deep(DEPTH_MAX).unwrap().len(), 1);
    let one_more = deep(DEPTH_MAX + 1);
    assert!(matches!(one_more, Err(ParamFileError::Shape { .. })));
    assert!(matches!(deep(100_000), Err(ParamFileError::Scan { .. })));
}

#[test]
fn large_files_and_other_things_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("params.yaml");
    let of = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    };
    let length = usize::try_from(FILE_BYTES_MAX).unwrap();
    assert_eq!(of(&vec![b' '; length]).unwrap(), vec![]);
    let large = of(&vec![b' '; length + 1]);
    assert!(matches!(large, Err(ParamFileError::TooLarge { .. })));
    let binary = of(&[0xff, 0xfe]);
    assert!(matches!(binary, Err(ParamFileError::Yaml { .. })));
    let no_file = read(directory.path());
    assert!(matches!(no_file, Err(ParamFileError::NotAFile { .. })));
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,80}|[-\\[\\]{}:,'\"&*#|>!% \n0-9a-c/]{0,80}") {
        let _ = read_text(&text);
        let _ = read_text(&format!("m:\n  ros__parameters:\n    {text}"));
    }
}

#[test]
fn a_fifo_is_refused_and_not_waited_for() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("params.yaml");
    let made = std::process::Command::new("mkfifo").arg(&path).status();
    assert!(made.unwrap().success());
    let (sender, refused) = std::sync::mpsc::channel();
    std::thread::spawn(move || sender.send(read(&path)));
    let refused = refused.recv_timeout(std::time::Duration::from_secs(10));
    let refused = refused.expect("reading waits for a writer");
    assert!(matches!(refused, Err(ParamFileError::NotAFile { .. })));
}

#[test]
fn a_byte_order_mark_is_passed_over() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("windows.yaml");
    let text = "mapper:\n  ros__parameters:\n    rate: 1.0\n";
    std::fs::write(&path, text).unwrap();
    let expected = read(&path).unwrap();
    assert_eq!(expected.len(), 1);
    let marked = format!("\u{feff}{}", text.replace('\n', "\r\n"));
    std::fs::write(&path, marked).unwrap();
    assert_eq!(read(&path).unwrap(), expected);
}
