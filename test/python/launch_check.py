"""Runs the launch files with a stand-in for launch and launch_ros, which takes what the real ones take, and
compares the XML ones with the elements and attributes that launch documents.

    launch_check.py LAUNCH_FOLDER     prints a line of JSON: what each file starts
"""

import json
import sys
import types
from pathlib import Path
from xml.etree import ElementTree

# Names of the arguments that launch (Jazzy) knows of what is used here; the first ones by position.
CLASSES = {
    "launch": {"LaunchDescription": "entities"},
    "launch.actions": {
        "DeclareLaunchArgument": "name default_value description choices condition",
        "IncludeLaunchDescription": "launch_description_source launch_arguments condition",
        "SetEnvironmentVariable": "name value condition",
        "Shutdown": "reason",
    },
    "launch.launch_description_sources": {"PythonLaunchDescriptionSource": "location"},
    "launch.substitutions": {
        "EnvironmentVariable": "name default_value",
        "LaunchConfiguration": "variable_name default",
        "PathJoinSubstitution": "substitutions",
        "PythonExpression": "expression python_modules",
    },
    "launch_ros.actions": {
        "Node": "executable package name namespace exec_name parameters remappings ros_arguments"
        " arguments output respawn respawn_delay on_exit condition",
    },
    "launch_ros.parameter_descriptions": {"ParameterValue": "value value_type"},
    "launch_ros.substitutions": {"FindPackageShare": "package"},
}
ELEMENTS = {
    "launch": "",
    "arg": "name default description value",
    "set_env": "name value",
    "include": "file",
    "node": "pkg exec name namespace output ros_args args respawn respawn_delay",
    "param": "from name value type",
    "remap": "from to",
}


def stand_in(name, known):
    def init(self, *args, **more):
        assert len(args) <= len(known), f"{name} takes {known}"
        self.given = dict(zip(known, args))
        for key, value in more.items():
            assert key in known and key not in self.given, f"{name} takes no {key}"
            self.given[key] = value

    return type(name, (), {"__init__": init})


def install():
    sys.modules["launch_ros"] = types.ModuleType("launch_ros")
    for module, classes in CLASSES.items():
        sys.modules[module] = types.ModuleType(module)
        for name, known in classes.items():
            setattr(sys.modules[module], name, stand_in(name, known.split()))


def visit(value, seen, bound):
    given = getattr(value, "given", {})
    match type(value).__name__:
        case "DeclareLaunchArgument":
            seen.declared.add(given["name"])
            if given.get("default_value") is None:
                seen.required.add(given["name"])
        case "LaunchConfiguration":
            seen.used.add(given["variable_name"])
        case "IncludeLaunchDescription":
            path = given["launch_description_source"].given["location"].given["substitutions"]
            seen.follow(path[-1], dict(given.get("launch_arguments", [])))
        case "Node":
            assert given["package"] == "lattice_nodes"
            names = given["executable"], given["name"]
            names = [bound.get(n.given["variable_name"]) if hasattr(n, "given") else n for n in names]
            seen.nodes.append(names)
    parts = given if hasattr(value, "given") else value
    for part in parts.values() if isinstance(parts, dict) else parts:
        if hasattr(part, "given") or isinstance(part, (list, tuple, dict)):
            visit(part, seen, bound)


class Seen:
    """What a file starts, declares and uses, with the files that it includes."""

    def __init__(self, path, bound):
        self.path, self.nodes = path, []
        self.declared, self.required, self.used = set(), set(), set()
        if path.suffix == ".py":
            space = {}
            exec(compile(path.read_text(), path, "exec"), space)
            visit([space["generate_launch_description"]()], self, bound)
        else:
            self.see_xml(bound)
        assert self.used <= self.declared, f"{path}: {self.used - self.declared} is not declared"

    def follow(self, name, bound):
        other = Seen(self.path.parent / name, bound)
        unknown, missing = set(bound) - other.declared, other.required - set(bound)
        assert not unknown and not missing, f"{self.path}: {name} declares no {unknown}, needs {missing}"
        self.nodes += other.nodes
        self.declared |= other.declared

    def see_xml(self, bound):
        inner = set()
        for element in ElementTree.parse(self.path).iter():
            known = ELEMENTS[element.tag].split()
            assert set(element.attrib) <= set(known), f"{self.path}: {element.tag} {element.attrib}"
            for text in element.attrib.values():
                self.used |= {part.split(")")[0] for part in text.split("$(var ")[1:]}
            match element.tag:
                case "arg" if element not in inner:
                    assert "value" not in element.attrib, f"{self.path}: {element.attrib}"
                    self.declared.add(element.attrib["name"])
                    if "default" not in element.attrib:
                        self.required.add(element.attrib["name"])
                case "include":
                    inner |= set(element)
                    given = {arg.attrib["name"]: arg.attrib["value"] for arg in element}
                    self.follow(element.attrib["file"].rsplit("/")[-1], given)
                case "node":
                    assert element.attrib["pkg"] == "lattice_nodes"
                    names = [element.attrib["exec"], element.attrib["name"]]
                    self.nodes.append([bound.get("node") if n == "$(var node)" else n for n in names])


def main():
    install()
    found = {path.name: Seen(path, {}).nodes for path in sorted(Path(sys.argv[1]).iterdir())}
    # Those that are only included have no node of their own.
    print(json.dumps({name: nodes for name, nodes in found.items() if [None, None] not in nodes}))


main()
