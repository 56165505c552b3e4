"""A table, a folder with a pattern, or a data set in; jobs out, one at a time, however long the list is."""
