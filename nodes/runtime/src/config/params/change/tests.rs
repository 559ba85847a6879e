use std::sync::mpsc::{Receiver, channel};

use super::*;
use crate::config::params::{About, ParamError};

const TABLE: &[About] = crate::about! {
    "least_m": "Least.";
    "most_m": "Most.";
    "count": "How many.";
    "names": "Which.";
    "classes": "Of what kind.";
    "frame" fixed("it names the map"): "Where.";
};

type Options = (f64, f64, i64, Vec<String>, Vec<i64>);

fn read(params: &Params) -> Result<Options, ParamError> {
    params.string("frame", "map")?;
    let least_m = params.f64_in("least_m", 0.0, 0.0..=100.0)?;
    let most_m = params.f64_in("most_m", 50.0, 0.0..=100.0)?;
    if least_m > most_m {
        return Err(params.invalid("least_m", "expected at most `most_m`"));
    }
    let count = params.usize_in("count", 3, 1..=9)? as i64;
    let names = params.string_array("names", &["a"])?;
    Ok((
        least_m,
        most_m,
        count,
        names,
        params.i64_array("classes", &[1])?,
    ))
}

/// Parameters of a node, the options it was given since, and its notifications.
fn node() -> (Params, Receiver<Options>, Receiver<(Values, Values)>) {
    let given = [("most_m", ParamValue::I64(40))];
    let params = Params::from_values("/n", given);
    params.describe(TABLE);
    read(&params).unwrap();
    let (tell, told) = channel();
    params.listen(move |new, changed| drop(tell.send((new, changed))));
    let (send, options) = channel();
    params.open(move |candidate| {
        let options = read(candidate).map_err(|error| error.to_string())?;
        drop(send.send(options));
        Ok(())
    });
    (params, options, told)
}

fn value(text: &str) -> Option<ParamValue> {
    (!text.is_empty()).then(|| ParamValue::from_yaml_text(text).unwrap())
}

fn set(params: &Params, wanted: &[(&str, &str)]) -> Result<(), String> {
    let wanted = wanted.iter();
    let wanted = wanted.map(|(name, text)| ((*name).to_owned(), value(text)));
    params
        .set(wanted.collect())
        .map_err(|refusal| refusal.to_string())
}

#[test]
fn refusals_are_those_of_rclcpp() {
    let (params, options, told) = node();
    let before = params.declared();
    assert_eq!(told.try_recv().unwrap().0, before);
    let long = format!("[{}]", vec!["1"; MAX_VALUE_LENGTH + 1].join(", "));
    for (wanted, reason) in [
        (&[][..], "parameter list cannot be empty"),
        (
            &[("none", "1")],
            "parameter 'none' cannot be set because it was not declared",
        ),
        (
            &[("frame", "odom")],
            "parameter 'frame' cannot be set because it is read-only: it names the map",
        ),
        (
            &[("count", "")],
            "cannot undeclare a statically typed parameter",
        ),
        (
            &[("least_m", "off")],
            "Wrong parameter type, parameter {least_m} is of type {double}, setting it to \
             {string} is not allowed.",
        ),
        (
            &[("least_m", "1")],
            "Wrong parameter type, parameter {least_m} is of type {double}, setting it to \
             {integer} is not allowed.",
        ),
        (
            &[("most_m", "101.0")],
            "Parameter {most_m} doesn't comply with floating point range.",
        ),
        (
            &[("most_m", ".nan")],
            "Parameter {most_m} doesn't comply with floating point range.",
        ),
        (
            &[("count", "0")],
            "Parameter {count} doesn't comply with integer range.",
        ),
        (
            &[("classes", &long)],
            "parameter 'classes' is longer than 65536",
        ),
        (
            &[("most_m", "30.0"), ("least_m", "35.0")],
            "parameter `least_m` of /n = 35.0 (set at run time): expected at most `most_m`",
        ),
        (
            &[("most_m", "30.0"), ("count", "10")],
            "Parameter {count} doesn't comply with integer range.",
        ),
    ] {
        assert_eq!(set(&params, wanted).unwrap_err(), reason);
    }
    assert_eq!(params.declared(), before, "nothing has changed");
    assert!(options.try_recv().is_err() && told.try_recv().is_err());
}

#[test]
fn the_node_is_given_all_options_as_they_then_are() {
    let (params, options, told) = node();
    told.try_recv().unwrap();
    set(
        &params,
        &[("least_m", "35.0"), ("names", "[]"), ("classes", "[]")],
    )
    .unwrap();
    assert_eq!(options.try_recv().unwrap(), (35.0, 40.0, 3, vec![], vec![]));
    let (new, changed) = told.try_recv().unwrap();
    assert!(new.is_empty());
    let names: Vec<_> = changed.keys().collect();
    assert_eq!(names, ["classes", "least_m", "names"]);
    assert_eq!(params.declared()["classes"], ParamValue::I64Array(vec![]));
    // What one change has set holds for the next.
    assert!(set(&params, &[("most_m", "34.0")]).is_err());
    set(&params, &[("count", "4")]).unwrap();
    assert_eq!(options.try_recv().unwrap().0, 35.0);
    params.note("count", ParamValue::I64(5));
    assert_eq!(
        told.try_iter().last().unwrap().1["count"],
        ParamValue::I64(5)
    );
    set(&params, &[("least_m", "1.0")]).unwrap();
    assert_eq!(options.try_recv().unwrap().2, 5);
}

#[test]
fn nothing_is_set_before_the_node_is_ready_nor_against_the_second_who_is_asked() {
    let params = Params::default();
    params.describe(TABLE);
    read(&params).unwrap();
    assert!(
        set(&params, &[("count", "4")])
            .unwrap_err()
            .contains("not running")
    );
    params.also_apply(|_| Err("the clock stands".to_owned()));
    params.open(|_| Ok(()));
    assert_eq!(
        set(&params, &[("count", "4")]).unwrap_err(),
        "the clock stands"
    );
}

#[test]
fn a_fixed_parameter_may_be_given_the_value_that_it_has() {
    let (params, options, told) = node();
    told.try_recv().unwrap();
    set(&params, &[("frame", "map")]).unwrap();
    assert!(options.try_recv().is_err() && told.try_recv().is_err());
    set(&params, &[("frame", "map"), ("count", "4")]).unwrap();
    assert_eq!(options.try_recv().unwrap().2, 4);
    let changed: Vec<_> = told.try_recv().unwrap().1.into_keys().collect();
    assert_eq!(changed, ["count"]);
    assert!(set(&params, &[("frame", "odom"), ("count", "5")]).is_err());
    assert!(set(&params, &[("frame", "")]).is_err());
}

#[test]
fn values_come_back_as_yaml_has_them() {
    let text = |text: &str| ParamValue::String(text.to_owned());
    for (now, value) in [
        (text("off"), ParamValue::Bool(false)),
        (text("on"), ParamValue::Bool(true)),
        (text("5"), ParamValue::I64(5)),
        (ParamValue::F64(1e-6), text("1e-06")),
    ] {
        assert_eq!(of_yaml(value.clone(), &now), now, "{value:?}");
    }
    for (now, value) in [
        (text("off"), ParamValue::Bool(true)),
        (text("05"), ParamValue::I64(5)),
        (ParamValue::F64(1e-6), text("2e-06")),
    ] {
        assert_eq!(of_yaml(value.clone(), &now), value);
    }
}
