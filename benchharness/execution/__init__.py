"""Jobs -> processes -> the folder of a run."""
