//! Tests of the reader of definitions.

use proptest::prelude::*;

use super::*;

fn message(text: &str) -> Message {
    match parse(text, "msg").unwrap() {
        Definition::Message(message) => message,
        other => panic!("{other:?}"),
    }
}

#[test]
fn comments_belong_to_what_they_stand_at() {
    let read = message(
        "# Of the message,\n# on two lines.\n\n# of no field\n\n# of a\nint32 a # and behind it\n        # and below\n\
         # of b\nstring B=\"#1\" # of the constant\n",
    );
    assert_eq!(read.comment, ["Of the message,", "on two lines."]);
    assert_eq!(
        read.fields[0].comment,
        ["of a", "and behind it", "and below"]
    );
    assert_eq!(read.constants[0].comment, ["of b", "of the constant"]);
    assert_eq!(read.constants[0].value, "\"#1\"");
    // Without an empty line behind it, what stands at the start is of the message.
    assert_eq!(message("# head\nint32 a\n").comment, ["head"]);
    assert_eq!(
        message("# a message without fields\n").comment,
        ["a message without fields"]
    );
}

#[test]
fn types_defaults_and_constants() {
    let read = message(
        "geometry_msgs/Pose[] poses\nstring<=10[<=3] names\nuint8[16] id\nfloat64 w 1.5\nint8 A = -1\nstring s 'a b'\n",
    );
    let element = |package: &str, name: &str| Element::Message {
        package: Some(package.to_owned()),
        name: name.to_owned(),
    };
    let kinds: Vec<_> = read.fields.iter().map(|field| field.kind.clone()).collect();
    let kind = |element, array| Kind { element, array };
    assert_eq!(
        kinds,
        [
            kind(element("geometry_msgs", "Pose"), Array::Sequence),
            kind(Element::String, Array::Sequence),
            kind(Element::Primitive("u8"), Array::Fixed(16)),
            kind(Element::Primitive("f64"), Array::One),
            kind(Element::String, Array::One),
        ]
    );
    assert_eq!(read.fields[3].default.as_deref(), Some("1.5"));
    assert_eq!(read.fields[4].default.as_deref(), Some("'a b'"));
    assert_eq!(read.constants[0].value, "-1");
}

#[test]
fn faults_have_their_lines() {
    for (text, ending, line, part) in [
        ("int32\n", "msg", 1, "a type and a name"),
        ("\nint32 a\nint32 a\n", "msg", 3, "stands twice"),
        ("int32 1a\n", "msg", 1, "no name"),
        ("wstring a\n", "msg", 1, "`wstring` is not supported"),
        ("int a\n", "msg", 1, "no type"),
        ("int32[x] a\n", "msg", 1, "not an integer above 0"),
        ("int32[0] a\n", "msg", 1, "not an integer above 0"),
        ("int32[ a\n", "msg", 1, "no `]`"),
        ("int32<=3 a\n", "msg", 1, "only strings"),
        (
            "string<=x a\n",
            "msg",
            1,
            "length `x` is not an unsigned integer",
        ),
        ("int32[] A=3\n", "msg", 1, "a constant is"),
        ("int32 a\n---\n", "msg", 3, "2 parts"),
        ("int32 a\n", "srv", 1, "1 parts"),
        ("---\nint32 a\n---\nint b\n", "action", 4, "no type"),
    ] {
        let (at, reason) = parse(text, ending).unwrap_err();
        assert_eq!(at, line, "{text}");
        assert!(reason.contains(part), "{text}: {reason}");
    }
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in "([a-z0-9_/\\[\\]<>=#'\" .-]{0,30}\n){0,6}", bytes in ".{0,60}") {
        for text in [&text, &bytes] {
            for ending in ["msg", "srv", "action"] {
                if let Err((line, _)) = parse(text, ending) {
                    prop_assert!(line <= text.lines().count() + 1);
                }
            }
        }
    }
}
