//! Changes of parameters while the node runs, by the rules of rclcpp (`node_parameters.cpp`).

use std::collections::BTreeMap;

use super::{Given, Origin, ParamValue, Params, Range, State};
use crate::sync::lock;

/// Longest value that is taken, in characters or items.
const MAX_VALUE_LENGTH: usize = 1 << 16;

/// Takes all parameters as they would be, or says why not; nothing changes then.
type Apply = Box<dyn FnMut(&Params) -> Result<(), String> + Send>;

/// Hears of parameters that are new, and of those that have changed.
type Listener = Box<dyn FnMut(Values, Values) + Send>;

/// Parameters by name.
pub(crate) type Values = BTreeMap<String, ParamValue>;

/// Those who take part in a change; one change at a time.
#[derive(Default)]
pub(super) struct Changes {
    /// The node; none: it is not at work.
    node: Option<Apply>,
    apply: Vec<Apply>,
    is_open: bool,
    listener: Option<Listener>,
}

/// Error of a change that is refused.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Refusal {
    /// No such parameter.
    #[error("parameter '{0}' cannot be set because it was not declared")]
    NotDeclared(String),
    /// All else.
    #[error("{0}")]
    Other(String),
}

impl Params {
    /// Lets parameters be changed from now on, and tells listeners which there are.
    ///
    /// `apply` is given all parameters as they would be: it reads its options as at the start, and hands
    /// them to the node or says why not. It must return at once.
    pub fn open(&self, apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static) {
        let mut changes = lock(&self.changes);
        changes.node = Some(Box::new(apply));
        changes.is_open = true;
        drop(changes);
        self.tell_new();
    }

    /// Lets nothing be changed any more, since the node is not at work.
    pub fn close(&self) {
        let mut changes = lock(&self.changes);
        changes.is_open = false;
        let node = changes.node.take();
        // What the node handed over may end with it.
        drop((changes, node));
    }

    /// One more who is asked; the first says last.
    pub(crate) fn also_apply(
        &self,
        apply: impl FnMut(&Params) -> Result<(), String> + Send + 'static,
    ) {
        lock(&self.changes).apply.insert(0, Box::new(apply));
    }

    /// Sets who hears of changes, and tells it which parameters there are by now.
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

    /// Takes note of a value that the node has changed itself.
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

    /// Changes all of these, or none; `None` stands for a value that is to go.
    pub(crate) fn set(&self, wanted: Vec<(String, Option<ParamValue>)>) -> Result<(), Refusal> {
        let mut changes = lock(&self.changes);
        let values = lock(&self.state).check(wanted)?;
        if !changes.is_open {
            let reason = "the node is not at work yet, or no more";
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

    /// All parameters as they would be, not declared yet.
    fn candidate(&self, values: &Values) -> Params {
        let mut state = lock(&self.state).clone();
        // As they were read: nothing is to be converted again.
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
    /// A value that was set at run time.
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
    /// The values, if each by itself may be set; in the order of rclcpp's checks.
    fn check(&self, wanted: Vec<(String, Option<ParamValue>)>) -> Result<Values, Refusal> {
        let refuse = |reason: String| Err(Refusal::Other(reason));
        if wanted.is_empty() {
            return refuse("parameter list cannot be empty".to_owned());
        }
        for (name, _) in &wanted {
            match self.declared.get(name).map(|declared| declared.fixed()) {
                None => return Err(Refusal::NotDeclared(name.chars().take(256).collect())),
                Some(Some(why)) => {
                    return refuse(format!(
                        "parameter '{name}' cannot be set because it is read-only: {why}"
                    ));
                }
                Some(None) => {}
            }
        }
        if wanted.iter().any(|(_, value)| value.is_none()) {
            return refuse("cannot undeclare a statically typed parameter".to_owned());
        }
        let mut values = Values::new();
        for (name, value) in wanted {
            let (Some(value), Some(declared)) = (value, self.declared.get(&name)) else {
                continue;
            };
            // An empty list has no type where YAML gives it.
            let value = match declared.value.is_array() && value.is_empty_list() {
                true => declared.value.emptied(),
                false => value,
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

/// Kind of the range that the value is not in.
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
