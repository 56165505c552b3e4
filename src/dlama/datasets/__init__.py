"""A folder in; frames with ground truth, and the cases of each protocol, out. One file for each layout on disk.

Begin with `frames` (the nouns) and `layouts` (all layouts, and `open_dataset`). Layouts of posed frames are in `posed`, what
phones and robots record in `captures`, EasySynth in `easysynth`; `sequences` completes a data set into another.
`text_tables` reads their listings.
"""
