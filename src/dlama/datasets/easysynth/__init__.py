"""A folder in EasySynth's layout (Unreal Engine) in; its frames and cases of all protocols out; and folders written back.

Begin with `dataset`: `listing` finds the files of each frame, `text_files` reads poses, `frames` reads pictures. `writer` is the
way back.
"""
