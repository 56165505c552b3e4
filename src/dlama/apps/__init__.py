"""The command line: words in; files, lines on the terminal and exit codes out. Begin with `cli`, then `verbs`."""
