//! Module of a package: structs of its messages, services and actions.

use std::fmt::Write as _;

use crate::GenerateError;
use crate::definition::{Definition, Message};
use crate::documentation::{add_doc, doc};
use crate::names::Names;
use crate::package::{File, Package};
use crate::structs::{Struct, Structs};

/// Messages that ROS derives from an action: part, half of a service, and definition.
const ACTION_PARTS: [(&str, &str, &str); 5] = [
    (
        "SendGoal",
        "_Request",
        "unique_identifier_msgs/UUID goal_id # Id of the goal, chosen by the client.\nACTION_Goal goal # Goal itself.\n",
    ),
    (
        "SendGoal",
        "_Response",
        "bool accepted # True if the server accepts the goal.\nbuiltin_interfaces/Time stamp # Time of the decision.\n",
    ),
    (
        "GetResult",
        "_Request",
        "unique_identifier_msgs/UUID goal_id # Id of the goal.\n",
    ),
    (
        "GetResult",
        "_Response",
        "int8 status # Status of the goal, one of `action_msgs/msg/GoalStatus`.\nACTION_Result result # Outcome of the goal.\n",
    ),
    (
        "FeedbackMessage",
        "",
        "unique_identifier_msgs/UUID goal_id # Id of the goal.\nACTION_Feedback feedback # Progress of the goal.\n",
    ),
];

/// Writer of the Rust modules of packages.
pub struct Writer<'a> {
    structs: Structs<'a>,
}

impl<'a> Writer<'a> {
    pub fn new(names: &'a Names<'a>) -> Self {
        Self {
            structs: Structs { names },
        }
    }

    fn root(&self) -> &'static str {
        self.structs.names.root
    }

    /// Code of a package: the inside of its module.
    pub fn package(&self, package: &Package) -> Result<String, GenerateError> {
        let (mut code, mut visited) = (String::new(), Vec::new());
        for file in &package.files {
            visited.extend(self.file(&mut code, &package.name, file)?);
        }
        let root = self.root();
        let visits = visited.iter();
        let visits = visits.map(|name| format!("    visitor.visit::<{name}>();\n"));
        let visits: String = visits.collect();
        let _ = write!(
            code,
            "/// Passes every message, and every part of a service or an action, to the visitor.\n\
             pub fn visit_messages(visitor: &mut impl {root}::MessageVisitor) {{\n{visits}}}\n"
        );
        Ok(code)
    }

    /// Adds what a file defines; names of the structs of messages.
    fn file(
        &self,
        code: &mut String,
        here: &str,
        file: &File,
    ) -> Result<Vec<String>, GenerateError> {
        let name = &file.name;
        match &file.definition {
            Definition::Message(message) => {
                let type_name = format!("{here}/msg/{name}");
                let comment = comment(&message.comment, || format!("Message `{type_name}`."));
                let part = Struct {
                    name: name.clone(),
                    type_name,
                    comment,
                    message,
                };
                self.structs.add(code, &part, here, file)?;
                Ok(vec![part.name])
            }
            Definition::Service(parts) => {
                let [request, _] = parts;
                let ros = format!("{here}/srv/{name}");
                add_marker(
                    code,
                    name,
                    &comment(&request.comment, || format!("Service `{ros}`.")),
                );
                self.add_service(code, name, &ros);
                let named = ["Request", "Response"].into_iter().zip(parts);
                self.add_parts(code, (here, file), (name, &ros), named)
            }
            Definition::Action(parts) => {
                let [goal, ..] = parts;
                let (ros, marker) = (format!("{here}/action/{name}"), format!("{name}Action"));
                add_marker(
                    code,
                    &marker,
                    &comment(&goal.comment, || format!("Action `{ros}`.")),
                );
                let named = ["Goal", "Result", "Feedback"].into_iter().zip(parts);
                let mut names = self.add_parts(code, (here, file), (&marker, &ros), named)?;
                names.extend(self.add_action(code, here, file)?);
                Ok(names)
            }
        }
    }

    /// Adds the messages of a service or an action, which has the struct `owner` and a type name in ROS.
    fn add_parts<'b>(
        &self,
        code: &mut String,
        (here, file): (&str, &File),
        (owner, ros): (&str, &str),
        parts: impl Iterator<Item = (&'static str, &'b Message)>,
    ) -> Result<Vec<String>, GenerateError> {
        let mut names = Vec::new();
        for (index, (half, message)) in parts.enumerate() {
            let mut comment = vec![format!("{half} of [`{owner}`].")];
            // That of the first part is of the whole.
            if let Some(more) = doc(&message.comment).filter(|_| index > 0) {
                comment.push(String::new());
                comment.extend(more);
            }
            let part = Struct {
                name: format!("{}{half}", file.name),
                type_name: format!("{ros}_{half}"),
                comment,
                message,
            };
            self.structs.add(code, &part, here, file)?;
            names.push(part.name);
        }
        Ok(names)
    }

    fn path(
        &self,
        here: &str,
        package: &str,
        name: &str,
        file: &File,
    ) -> Result<String, GenerateError> {
        let path = self.structs.names.path(here, Some(package), name);
        path.map_err(|text| file.fault(1, text))
    }

    fn add_service(&self, code: &mut String, name: &str, type_name: &str) {
        let _ = writeln!(
            code,
            "impl {}::RosService for {name} {{\n    const TYPE: &'static str = \"{type_name}\";\n    \
             type Request = {name}Request;\n    type Response = {name}Response;\n}}\n",
            self.root()
        );
    }

    /// Services and topics of an action; names of their messages.
    fn add_action(
        &self,
        code: &mut String,
        here: &str,
        file: &File,
    ) -> Result<Vec<String>, GenerateError> {
        let (root, name, ros) = (
            self.root(),
            &file.name,
            format!("{here}/action/{}", file.name),
        );
        for (part, path) in [("SendGoal", "send_goal"), ("GetResult", "get_result")] {
            let title = format!("Service `_action/{path}` of [`{name}Action`].");
            let service = format!("{name}{part}");
            add_marker(code, &service, &[title]);
            self.add_service(code, &service, &format!("{ros}_{part}"));
        }
        let mut names = Vec::new();
        for (part, half, text) in ACTION_PARTS {
            let text = text.replace("ACTION", &format!("{here}/{name}"));
            let message = Message::parse(&text);
            let message = message.map_err(|(line, text)| file.fault(line, text))?;
            let title = match half {
                "" => format!("Message of `_action/feedback` of [`{name}Action`]."),
                _ => format!("{} of [`{name}{part}`].", half.trim_start_matches('_')),
            };
            let part = Struct {
                name: format!("{name}{part}{half}").replace('_', ""),
                type_name: format!("{ros}_{part}{half}"),
                comment: vec![title],
                message: &message,
            };
            self.structs.add(code, &part, here, file)?;
            names.push(part.name);
        }
        let uuid = self.path(here, "unique_identifier_msgs", "UUID", file)?;
        let time = self.path(here, "builtin_interfaces", "Time", file)?;
        let _ = writeln!(
            code,
            "impl {root}::RosAction for {name}Action {{
    const TYPE: &'static str = \"{ros}\";
    type Goal = {name}Goal;
    type Result = {name}Result;
    type Feedback = {name}Feedback;
    type SendGoal = {name}SendGoal;
    type GetResult = {name}GetResult;
    type FeedbackMessage = {name}FeedbackMessage;

    fn goal(request: {name}SendGoalRequest) -> ({uuid}, {name}Goal) {{
        (request.goal_id, request.goal)
    }}

    fn accepted(accepted: bool, stamp: {time}) -> {name}SendGoalResponse {{
        {name}SendGoalResponse {{ accepted, stamp }}
    }}

    fn wanted(request: &{name}GetResultRequest) -> {uuid} {{
        request.goal_id
    }}

    fn result(status: i8, result: {name}Result) -> {name}GetResultResponse {{
        {name}GetResultResponse {{ status, result }}
    }}

    fn feedback(goal_id: {uuid}, feedback: {name}Feedback) -> {name}FeedbackMessage {{
        {name}FeedbackMessage {{ goal_id, feedback }}
    }}
}}
"
        );
        Ok(names)
    }
}

/// Documentation of a definition, or a sentence in its place.
fn comment(lines: &[String], otherwise: impl Fn() -> String) -> Vec<String> {
    doc(lines).unwrap_or_else(|| vec![otherwise()])
}

/// Struct without fields that stands for a service or an action.
fn add_marker(code: &mut String, name: &str, comment: &[String]) {
    add_doc(code, "", comment);
    let _ = writeln!(code, "#[derive(Clone, Copy, Debug)]\npub struct {name};\n");
}
