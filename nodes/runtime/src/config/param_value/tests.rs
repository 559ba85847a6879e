use super::*;
use proptest::prelude::*;

fn read(text: &str) -> ParamValue {
    ParamValue::from_yaml_text(text).unwrap()
}

#[test]
fn plain_scalars_have_the_types_of_rcl() {
    let text = |text: &str| ParamValue::String(text.to_owned());
    for (yaml, value) in [
        ("true", ParamValue::Bool(true)),
        ("1", ParamValue::I64(1)),
        ("0x1F", ParamValue::I64(31)),
        ("-3", ParamValue::I64(-3)),
        ("1.0", ParamValue::F64(1.0)),
        ("1e3", ParamValue::F64(1000.0)),
        ("-.inf", ParamValue::F64(f64::NEG_INFINITY)),
        ("18446744073709551615", ParamValue::F64(u64::MAX as f64)),
        ("~/bar", text("~/bar")),
        ("null", text("null")),
        ("''", text("")),
        ("hello world", text("hello world")),
    ] {
        assert_eq!(read(yaml), value, "{yaml}");
    }
}

#[test]
fn words_and_octals_become_what_is_wanted() {
    for yes in "y Y yes Yes YES on On ON true True TRUE".split(' ') {
        assert_eq!(read(yes).as_bool(), Some(true), "{yes}");
    }
    for no in "n N no No NO off Off OFF false False FALSE".split(' ') {
        assert_eq!(read(no).as_bool(), Some(false), "{no}");
    }
    let octal = [("010", 8), ("-017", -15), ("+7", 7), ("0", 0)];
    for (text, value) in octal.into_iter().chain([("0X1f", 31), ("-0x10", -16)]) {
        assert_eq!(read(text).as_i64(), Some(value), "{text}");
        assert_eq!(read(text).as_f64(), Some(value as f64), "{text}");
    }
    assert_eq!(read("08.5").as_f64(), Some(8.5));
    assert_eq!(read("oN").as_bool(), None);
    for none in ["08", "0x", "9223372036854775808"] {
        assert_eq!(read(none).as_i64(), None, "{none}");
    }
}

#[test]
fn quotes_make_a_text() {
    for text in ["'5'", "\"true\"", "'1.5'", "'0x10'"] {
        let value = read(text);
        let read = (value.as_bool(), value.as_i64(), value.as_f64());
        assert_eq!(read, (None, None, None), "{text}");
        assert!(value.as_str().is_some(), "{text}");
    }
}

#[test]
fn lists_have_one_type() {
    let texts = ["a", "b"].map(str::to_owned);
    for (yaml, list) in [
        ("[1, 010]", ParamValue::I64Array(vec![1, 8])),
        ("[yes, true]", ParamValue::BoolArray(vec![true, true])),
        (
            "[1.0, .inf]",
            ParamValue::F64Array(vec![1.0, f64::INFINITY]),
        ),
        ("[a, b]", ParamValue::StringArray(texts.into())),
        ("[]", ParamValue::StringArray(vec![])),
    ] {
        assert_eq!(read(yaml), list, "{yaml}");
    }
    for mixed in ["[1, 2.0]", "[2.0, 1]", "[1, a]", "[true, 1]", "[a, 1.5]"] {
        let error = ParamValue::from_yaml_text(mixed).unwrap_err();
        assert!(matches!(error, ValueError::Mixed(..)), "{mixed}: {error}");
    }
}

#[test]
fn everything_else_is_refused() {
    for (text, error) in [
        ("", ValueError::Missing),
        ("# nothing", ValueError::Missing),
        ("{a: 1}", ValueError::Shape("a map")),
        ("[[1]]", ValueError::Shape("a list in a list")),
        ("!tag 1", ValueError::Shape("a tagged value")),
        ("[~]", ValueError::Missing),
        ("*a", ValueError::Scan(ScanError::Anchor { line: 1 })),
        ("&a 1", ValueError::Scan(ScanError::Anchor { line: 1 })),
    ] {
        assert_eq!(ParamValue::from_yaml_text(text), Err(error), "{text}");
    }
    let cut = ParamValue::from_yaml_text("[1");
    assert!(matches!(cut, Err(ValueError::Yaml(_))));
    let deep = ParamValue::from_yaml_text(&"[".repeat(100_000));
    assert!(matches!(deep, Err(ValueError::Scan(_))));
}

proptest! {
    #[test]
    fn any_integer_reads_back(value: i64) {
        prop_assert_eq!(read(&value.to_string()), ParamValue::I64(value));
        let magnitude = value.unsigned_abs();
        let sign = if value < 0 { "-" } else { "" };
        prop_assert_eq!(c_integer(&format!("{sign}0{magnitude:o}")), Some(value));
        prop_assert_eq!(c_integer(&format!("{sign}0x{magnitude:x}")), Some(value));
    }

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,40}|[-\\[\\]{}:,'\"&*#|>!%@ \n0-9a-fx.]{0,40}") {
        if let Ok(value) = ParamValue::from_yaml_text(&text) {
            let _ = (value.as_bool(), value.as_i64(), value.as_f64(), value.to_string());
        }
    }
}
