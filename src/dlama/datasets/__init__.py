"""Data sets: a folder or a name -> frames with ground truth and the cases of each protocol. One file per layout."""
