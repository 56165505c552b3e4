"""Many posed frames in; the data set that `dlama sequence` completes them into out. Begin with `sequence`."""
