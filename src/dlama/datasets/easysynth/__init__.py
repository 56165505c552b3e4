"""A folder in EasySynth's layout (Unreal Engine) in; its frames and cases of all protocols out; and folders written back.

Begin with `dataset`: `frames` finds the files of each frame and reads them, `text_files` reads poses. `writer` is the way back.
"""
