"""Options of one verb in; what the public function of that name did, in lines, out.

`pictures` has the verbs of one picture or pair; each other verb has a file, or two. What computes (cv2, numba, torch) is imported
where it is used: `--help` and wrong words are answered at once.
"""
