"""Validates TOML files against a JSON Schema on standard input; prints the errors of each file as JSON."""

import json
import sys
import tomllib

import jsonschema

schema = json.load(sys.stdin)
jsonschema.Draft202012Validator.check_schema(schema)
validator = jsonschema.Draft202012Validator(schema)
errors = {}
for path in sys.argv[1:]:
    with open(path, "rb") as file:
        errors[path] = [error.message for error in validator.iter_errors(tomllib.load(file))]
print(json.dumps(errors))
