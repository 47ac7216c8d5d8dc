"""Fuzzing of all that decodes what comes from elsewhere: C++ by libFuzzer (`native`), scenes and records here (`scenes`,
`records`). Only in the source tree."""
