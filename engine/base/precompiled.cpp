// Stands for precompiled.h, which other targets take from here.
