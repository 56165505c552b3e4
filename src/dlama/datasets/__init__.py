"""A folder in; frames with ground truth, and the cases of each protocol, out. One file for each layout on disk.

Begin with `frames` (the nouns) and `layouts` (all layouts, and `open_dataset`). Layouts of posed frames share `posed_frames`
(files of a frame and its camera) and `view_pairs` (which frames make a case); `text_tables` reads their listings.
"""
