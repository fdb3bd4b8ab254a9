# Prints FILE:LINE LINES NAME for each function of C++ or GLSL files that are laid out as clang-format does it here: a
# function begins at the indentation of its scope (a file, a class) and ends with a brace at the same one. Functions
# within functions count as part of these; tables (= {...}) are none.
FNR == 1 { depth = 0; start = 0; inBody = 0; head = "" }
{ sub(/\r$/, "") }
/^[ \t]*$/ || /^[ \t]*\/\// || /^#/ { next }
{
    match($0, /^ */)
    indent = RLENGTH
    line = substr($0, indent + 1)
    sub(/ *\/\/.*$/, "", line)
    if (inBody) {  # until the brace that ends it
        if (indent == bodyIndent && line ~ /^}/) {
            if (isFunction) print FILENAME ":" start, FNR - start + 1, name
            inBody = 0
        }
        next
    }
    if (depth > 0 && indent == scope[depth] && line ~ /^}/) { --depth; head = ""; next }
    if (line ~ /^}/ || line ~ /^(public|private|protected):/ || line ~ /^case /) { head = ""; next }
    if (head == "") { start = FNR; startIndent = indent; head = line } else head = head " " line
    if (line ~ /[;}\]]$/) { head = ""; next }
    if (line !~ /\{$/) next
    text = head
    head = ""
    sub(/^template *<.*> *(class|struct)/, "class", text)
    if (text ~ /^(inline )?namespace/ || text ~ /^extern "C"/) next
    if (text ~ /^(class|struct|union)[ {]/ && text !~ /\) *(const)? *\{$/) { scope[++depth] = startIndent; next }
    inBody = 1
    bodyIndent = startIndent
    isFunction = text ~ /\(/ && text !~ /^(enum|layout)/ && text !~ /\) *= *\{+$/ && text !~ /^[^(]*= *\{/
    name = text
    sub(/\(.*/, "", name)
    sub(/^.*[ *&]/, "", name)
}
