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
    for (text, node) in [
        ("/**: {ros__parameters: {a: 1}}", "/x/y/mapper"),
        ("/*: {ros__parameters: {a: 1}}", "/mapper"),
        ("/**/mapper: {ros__parameters: {a: 1}}", "/x/mapper"),
        ("/**: {mapper: {ros__parameters: {a: 1}}}", "/x/mapper"),
        (
            "/x/**/bar: {b1/b2/**: {ros__parameters: {a: 1}}}",
            "/x/y/bar/b1/b2/mapper",
        ),
        (
            "robot: {mapper: {ros__parameters: {a: 1}}}",
            "/robot/mapper",
        ),
        (
            "/robot: {\"*\": {ros__parameters: {a: 1}}}",
            "/robot/mapper",
        ),
        (
            "/robot/: {mapper: {ros__parameters: {a: 1}}}",
            "/robot/mapper",
        ),
        ("/: {mapper: {ros__parameters: {a: 1}}}", "/mapper"),
        (
            "/**: {ros__parameters: {a: 1}, mapper: {ros__parameters: {a: 2}}}",
            "/x/mapper",
        ),
    ] {
        let params = read_text(text).unwrap();
        assert!(
            params.iter().all(|param| param.nodes.matches(node)),
            "{text}"
        );
        assert!(!params.is_empty());
    }
}

#[test]
fn empty_files_and_sections_have_no_parameters() {
    for text in [
        "",
        "# nothing\n",
        "---\n",
        "mapper: {ros__parameters: }",
        "mapper: {ros__parameters: {}}",
        "{}",
    ] {
        assert_eq!(read_text(text).unwrap(), vec![], "{text}");
    }
}

#[test]
fn wrong_shapes_say_where_and_what() {
    for (text, parts) in [
        ("mapper: 5", ["`mapper`", "a number", "ros__parameters"]),
        (
            "mapper: {ros_parameters: {a: 1}}",
            ["`mapper.ros_parameters.a`", "a number", "ros__parameters"],
        ),
        ("mapper: [1]", ["`mapper`", "a list", "ros__parameters"]),
        ("[1]", ["``", "a list", "a map of nodes"]),
        ("mapper:", ["`mapper`", "nothing", "ros__parameters"]),
        (
            "ros__parameters: {a: 1}",
            ["`ros__parameters`", "without a node", "a node name"],
        ),
        (
            "ma pper: {ros__parameters: {a: 1}}",
            ["`ma pper.ros__parameters`", "characters", "a node name"],
        ),
        (
            "a//b: {ros__parameters: {a: 1}}",
            ["`a//b.ros__parameters`", "empty part", "a node name"],
        ),
        (
            "mapper: {ros__parameters: 5}",
            [
                "`mapper.ros__parameters`",
                "a number",
                "a map of parameters",
            ],
        ),
        (
            "m: {ros__parameters: {a: }}",
            ["`m.ros__parameters.a`", "no value", "''"],
        ),
        (
            "m: {ros__parameters: {a: [1, b]}}",
            ["`m.ros__parameters.a`", "an integer", "a text"],
        ),
        (
            "m: {ros__parameters: {a: [[1]]}}",
            ["`m.ros__parameters.a`", "a list in a list", "expected"],
        ),
        (
            "m: {ros__parameters: {a: [{b: 1}]}}",
            ["`m.ros__parameters.a`", "a map", "expected"],
        ),
        (
            "m: {ros__parameters: {a: !x 1}}",
            ["`m.ros__parameters.a`", "a tagged value", "expected"],
        ),
        (
            "m: {ros__parameters: {'': 1}}",
            ["`m.ros__parameters`", "an empty text", "a name"],
        ),
        (
            "m: {ros__parameters: {[1]: 1}}",
            ["`m.ros__parameters`", "a list", "a name"],
        ),
        (
            "m: {ros__parameters: {a.b: 1, a: {b: 2}}}",
            ["`m.ros__parameters.a.b`", "again", "once"],
        ),
        (
            "m: {ros__parameters: {a: 1, a: 2}}",
            ["duplicate", "\"a\"", "test.yaml"],
        ),
        (
            "m: {ros__parameters: {a: &x 1}}",
            ["line 1", "anchors", "test.yaml"],
        ),
        (
            "m: {ros__parameters: {a: *x}}",
            ["line 1", "anchors", "test.yaml"],
        ),
        (
            "m: {ros__parameters: {a: 1}",
            ["line", "column", "test.yaml"],
        ),
        (
            "a: {ros__parameters: {a: 1}}\n---\nb: {ros__parameters: {a: 1}}",
            ["more than one document", "", ""],
        ),
    ] {
        let error = read_text(text).unwrap_err().to_string();
        assert!(error.contains("test.yaml"), "{text}: {error}");
        for part in parts {
            assert!(error.contains(part), "{text}: `{part}` is not in: {error}");
        }
    }
}

#[test]
fn deep_files_are_refused() {
    let deep = |levels: usize| {
        let maps = "{a: ".repeat(levels - 2);
        format!("m: {{ros__parameters: {maps}1{}}}", "}".repeat(levels - 2))
    };
    assert_eq!(read_text(&deep(DEPTH_MAX)).unwrap().len(), 1);
    assert!(matches!(
        read_text(&deep(DEPTH_MAX + 1)),
        Err(ParamFileError::Shape { .. })
    ));
    assert!(matches!(
        read_text(&deep(100_000)),
        Err(ParamFileError::Scan { .. })
    ));
}

#[test]
fn large_files_are_refused() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let length = usize::try_from(FILE_BYTES_MAX).unwrap();
    std::fs::write(file.path(), " ".repeat(length)).unwrap();
    assert_eq!(read(file.path()).unwrap(), vec![]);
    std::fs::write(file.path(), " ".repeat(length + 1)).unwrap();
    assert!(matches!(
        read(file.path()),
        Err(ParamFileError::TooLarge { .. })
    ));
    std::fs::write(file.path(), [0xff, 0xfe]).unwrap();
    assert!(matches!(
        read(file.path()),
        Err(ParamFileError::Yaml { .. })
    ));
    let directory = tempfile::tempdir().unwrap();
    assert!(matches!(
        read(directory.path()),
        Err(ParamFileError::NotAFile { .. })
    ));
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
