//Maya ASCII 2024 scene
//Codeset: 1252
/* A comment
   of two lines */
requires -nodeType "x" "mtoa" "5.3";
requires "faceware" "1";
requires maya "2024";
currentUnit -linear mm -angle rad -time 30fps;
file -r -ns "body" -dr 1 -typ "mayaAscii" "C:/body.ma";
file -rdi 1 -ns "b" "C:/b.ma";
fileInfo "application" "maya";
stray;
"text" ;
select -ne :time1;
	setAttr ".o" 1;
select -ne "face";
createNode transform -shared -name "face";
	rename -uid "0000-1";
	setAttr -l on -k off ".tx";
	setAttr ".translateX" 1;
	setAttr "face.rotateY" 0.5;
	setAttr "gone.tx" 1;
	setAttr "nothing";
	addAttr -ci true -sn "a" -ln "a" -at "double";
createNode mesh -n "faceShape" -parent "|face";
	setAttr -s 3 ".vt[0:2]" 0 0 0 1 0 0 0 1 0;
	setAttr -s 3 ".ed[0:2]" 0 1 0 1 2 0 2 0 0;
	setAttr ".fc[0]" -type "polyFaces" f 3 0 1 2;
createNode transform -n "a\"b\n\t\r\\c";
createNode unknown;
createNode transform -n "far";
parent -add "|face|faceShape" "far";
parent "face" "far";
parent -add "gone" "far";
parent -add;
lockNode -l 0 "far";
disconnectAttr "a.b" "c.d";
deleteAttr "a.b";
connectAttr "gone.o" "far.tx";
connectAttr "noattribute" "far.tx";
relationship "link" ":lightLinker1" "a" "b";
// End
