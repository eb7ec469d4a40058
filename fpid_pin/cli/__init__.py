"""The ``fpid-pin`` command: configurations in TOML, folders of results, progress bars, tables.

A thin room: it reads what a user wrote, calls what the other rooms offer, and says what came of
it. ``main`` names the subcommands; what each of them does is imported when it is asked for, so
that ``fpid-pin --help`` is quick.
"""
