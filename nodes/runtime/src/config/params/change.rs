//! Changes of parameters while the node runs, by the rules of rclcpp (`node_parameters.cpp`).

use super::ParamValue;
use super::about::Range;
use super::state::{Changes, Given, Origin, Params, State, Values};
use crate::sync::lock;

/// Longest accepted value, characters or items.
const MAX_VALUE_LENGTH: usize = 1 << 16;

/// Reason for rejecting a change.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refusal {
    /// Undeclared parameter.
    #[error("parameter '{0}' cannot be set because it was not declared")]
    NotDeclared(String),
    /// Any other reason.
    #[error("{0}")]
    Other(String),
}

impl Params {
    /// Makes parameters settable, and notifies listeners of the declared ones.
    ///
    /// `apply` receives all candidate values: it parses its options as at the start, and passes
    /// them to the node or returns the reason against them. It must return at once.
    pub fn open(&self, apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static) {
        let mut changes = lock(&self.changes);
        changes.node = Some(Box::new(apply));
        changes.is_open = true;
        drop(changes);
        self.tell_new();
    }

    /// Makes parameters read-only, since the node is not running.
    pub fn close(&self) {
        let mut changes = lock(&self.changes);
        changes.is_open = false;
        let node = changes.node.take();
        // Dropped outside the locks: values captured by the node may end with it.
        drop((changes, node));
    }

    /// Adds a further callback; the first one is called last.
    pub(crate) fn also_apply(
        &self,
        apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static,
    ) {
        lock(&self.changes).apply.insert(0, Box::new(apply));
    }

    /// Sets the listener of changes, and notifies it of the declared parameters.
    pub(crate) fn listen(&self, listener: impl FnMut(Values, Values) + Send + 'static) {
        lock(&self.changes).listener = Some(Box::new(listener));
        self.tell_new();
    }

    fn tell_new(&self) {
        let mut changes = lock(&self.changes);
        let mut state = lock(&self.state);
        let untold = state.declared.iter_mut().filter(|(_, one)| !one.told);
        let new: Values = untold
            .map(|(name, one)| {
                one.told = true;
                (name.clone(), one.value.clone())
            })
            .collect();
        drop(state);
        if !new.is_empty() {
            changes.tell(new, Values::new());
        }
    }

    /// Records a value that the node has changed itself.
    pub fn note(&self, name: &str, value: ParamValue) {
        let mut changes = lock(&self.changes);
        let mut state = lock(&self.state);
        if let Some(declared) = state.declared.get_mut(name) {
            declared.value = value.clone();
            state
                .given
                .insert(name.to_owned(), Given::set(value.clone()));
        }
        drop(state);
        changes.tell(Values::new(), [(name.to_owned(), value)].into());
    }

    /// Changes all of these parameters, or none; `None` removes a value.
    pub(crate) fn set(&self, wanted: Vec<(String, Option<ParamValue>)>) -> Result<(), Refusal> {
        let mut changes = lock(&self.changes);
        let values = lock(&self.state).check(wanted)?;
        if values.is_empty() {
            return Ok(());
        }
        if !changes.is_open {
            let reason = "the node is not running";
            return Err(Refusal::Other(reason.to_owned()));
        }
        let candidate = self.candidate(&values);
        let Changes { node, apply, .. } = &mut *changes;
        for apply in node.iter_mut().chain(apply) {
            apply(&candidate).map_err(Refusal::Other)?;
        }
        let State { given, .. } = std::mem::take(&mut *lock(&candidate.state));
        let mut state = lock(&self.state);
        state.given = given;
        for (name, value) in &values {
            if let Some(declared) = state.declared.get_mut(name) {
                declared.value = value.clone();
            }
        }
        drop(state);
        changes.tell(Values::new(), values);
        Ok(())
    }

    /// All parameters with candidate values, not declared yet.
    fn candidate(&self, values: &Values) -> Params {
        let mut state = lock(&self.state).clone();
        // Values as parsed: they need no further conversion.
        for (name, given) in &mut state.given {
            if let Some(declared) = state.declared.get(name) {
                given.value = declared.value.clone();
            }
        }
        for (name, value) in values {
            state.given.insert(name.clone(), Given::set(value.clone()));
        }
        state.declared.clear();
        let candidate = Params {
            node: self.node.clone(),
            ..Params::default()
        };
        *lock(&candidate.state) = state;
        candidate
    }
}

impl Given {
    /// Value set at run time.
    fn set(value: ParamValue) -> Self {
        Self {
            value,
            origin: Origin::Service,
            named: true,
        }
    }
}

impl Changes {
    fn tell(&mut self, new: Values, changed: Values) {
        if let Some(listener) = &mut self.listener {
            listener(new, changed);
        }
    }
}

impl State {
    /// Checks each value, in the order of rclcpp's checks; returns the values to set. A read-only parameter
    /// accepts its current value.
    fn check(&self, wanted: Vec<(String, Option<ParamValue>)>) -> Result<Values, Refusal> {
        let refuse = |reason: String| Err(Refusal::Other(reason));
        if wanted.is_empty() {
            return refuse("parameter list cannot be empty".to_owned());
        }
        let mut to_change = Vec::new();
        for (name, value) in wanted {
            let Some(declared) = self.declared.get(&name) else {
                return Err(Refusal::NotDeclared(name.chars().take(256).collect()));
            };
            let value = value.map(|value| of_yaml(value, &declared.value));
            match declared.fixed() {
                // `ros2 param load` sets everything that `ros2 param dump` has written.
                Some(_) if value.as_ref() == Some(&declared.value) => {}
                Some(why) => {
                    return refuse(format!(
                        "parameter '{name}' cannot be set because it is read-only: {why}"
                    ));
                }
                None => to_change.push((name, value)),
            }
        }
        if to_change.iter().any(|(_, value)| value.is_none()) {
            return refuse("cannot undeclare a statically typed parameter".to_owned());
        }
        let mut values = Values::new();
        for (name, value) in to_change {
            let (Some(value), Some(declared)) = (value, self.declared.get(&name)) else {
                continue;
            };
            if value.type_code() != declared.value.type_code() {
                let [is, would] = [&declared.value, &value].map(ParamValue::ros_type_name);
                return refuse(format!(
                    "Wrong parameter type, parameter {{{name}}} is of type {{{is}}}, setting it to \
                     {{{would}}} is not allowed."
                ));
            }
            if value.length() > MAX_VALUE_LENGTH {
                return refuse(format!(
                    "parameter '{name}' is longer than {MAX_VALUE_LENGTH}"
                ));
            }
            if let Some(kind) = outside(declared.range, &value) {
                return refuse(format!(
                    "Parameter {{{name}}} doesn't comply with {kind} range."
                ));
            }
            values.insert(name, value);
        }
        Ok(values)
    }
}

/// Converts a value that a tool has parsed from YAML to the type of the current value.
///
/// `ros2 param load` parses each value twice: an empty list has no type, the text `off` becomes a bool, and the
/// number `1e-06` a text.
fn of_yaml(value: ParamValue, now: &ParamValue) -> ParamValue {
    let is_same = match (now, &value) {
        (ParamValue::String(text), ParamValue::Bool(yes)) => {
            let names = if *yes { ["on", "yes"] } else { ["off", "no"] };
            names.contains(&&**text)
        }
        (ParamValue::String(text), ParamValue::I64(number)) => *text == number.to_string(),
        (ParamValue::F64(number), ParamValue::String(text)) => text.parse() == Ok(*number),
        _ => false,
    };
    match is_same {
        true => now.clone(),
        false if now.is_array() && value.is_empty_list() => now.emptied(),
        false => value,
    }
}

/// Kind of the violated range.
fn outside(range: Option<Range>, value: &ParamValue) -> Option<&'static str> {
    match (range, value) {
        (Some(Range::Integer(least, most)), ParamValue::I64(value)) => {
            (!(least..=most).contains(value)).then_some("integer")
        }
        (Some(Range::Float(least, most)), ParamValue::F64(value)) => {
            (!(least..=most).contains(value)).then_some("floating point")
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests;
