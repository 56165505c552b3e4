"""Options of one verb in; what the public function of that name did, in lines, out. One file a verb, two where one needs more."""
