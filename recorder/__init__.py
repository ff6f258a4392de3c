"""The recorder: takes frames from a camera and stores them in flight files, whatever happens."""
