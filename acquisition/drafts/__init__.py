"""Drafts of rig and protocol files: questions, their answers, and the commented YAML made of them.

Open `interview` first: it asks. `rig_questions` and `protocol_questions` say what; `rig_text` and
`protocol_text` make a file of the answers; `checks` loads it.
"""
