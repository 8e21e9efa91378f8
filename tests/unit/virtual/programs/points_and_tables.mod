MODULE Logger
    !> screen name;value;time
    !> screen x;1.5
    !> screen y;3
    !> screen z;4.5
    !> screen [1,2,3]
    !> screen more TRUE
    !> screen lines 6
    !> screen size 50
    !> screen v 321
    !> screen TRUE 5
    !> screen 12.5
    !> screen -3
    !> screen 7
    !> screen dir log_24.csv
    !> screen FALSETRUE
    !> screen no file
    !> screen not here
    VAR iodev logfile; VAR iodev infile;
    VAR clock t;
    VAR dir d;
    VAR string line; VAR num value; VAR num n:=0;
    VAR string names{3}:=["x","y","z"];
    VAR robtarget points{20};
    VAR num idx:=0;
    TRAP never
    ENDTRAP
    PROC main()
        VAR string filename;
        filename:="log_"+StrPart("2024",3,2)+".csv";
        IF NOT IsFile("HOME:/data"\Directory) MakeDir "HOME:/data";
        Open "HOME:"\File:="/data/"+filename,logfile\Write;
        Write logfile,"name;value;"\NoNewLine;
        Write logfile,"time";
        FOR i FROM 1 TO Dim(names,1) DO
            Write logfile,names{i}+";"\Num:=i*1.5;
        ENDFOR
        Write logfile,""\Pos:=[1,2,3];
        Close logfile;
        Open "HOME:/data/"+filename,logfile\Append;
        Write logfile,"more "\Bool:=TRUE;
        Close logfile;
        Open "HOME:/data/log_24.csv",infile\Read;
        line:=ReadStr(infile);
        WHILE line<>EOF DO
            Incr n;
            TPWrite line;
            line:=ReadStr(infile\RemoveCR\DiscardHeaders);
        ENDWHILE
        Close infile;
        TPWrite "lines "\Num:=n;
        TPWrite "size "\Num:=FileSize("HOME:/data/log_24.csv");
        Open "HOME:/pts.txt",infile\Write;
        Write infile,"1 2 3";
        Write infile,"[[4,5,6],[1,0,0,0]]";
        Write infile,"12.5,-3;7";
        Close infile;
        Open "HOME:/pts.txt",infile\Read;
        value:=ReadNum(infile\Delim:=" ");value:=value+ReadNum(infile\Delim:=" ")*10+ReadNum(infile)*100;
        TPWrite "v "\Num:=value;
        readPose infile;
        line:=ReadStr(infile\Delim:=",");
        TPWrite line;
        line:=ReadStr(infile\Delim:=";"); TPWrite line;
        line:=ReadStr(infile); TPWrite line;
        Close infile;
        OpenDir d,"HOME:/data";
        WHILE ReadDir(d,line) DO
            IF line<>"." AND line<>".." TPWrite "dir "+line;
        ENDWHILE
        CloseDir d;
        RenameFile "HOME:/pts.txt","HOME:/pts2.txt";
        CopyFile "HOME:/pts2.txt","HOME:/pts3.txt";
        RemoveFile "HOME:/pts2.txt";
        TPWrite ValToStr(IsFile("HOME:/pts2.txt"))+ValToStr(IsFile("HOME:/pts3.txt"));
        Open "HOME:/none.txt",infile\Read;
        TPWrite "not here";
        Stop;
    ERROR
        IF ERRNO=ERR_FILEOPEN THEN
            TPWrite "no file";
            TRYNEXT;
        ELSEIF ERRNO=ERR_FILNOTFND THEN
            TPWrite "nothing";
            TRYNEXT;
        ENDIF
        TPWrite "error "+ValToStr(ERRNO);
        RAISE;
    ENDPROC
    PROC readPose(VAR iodev f)
        VAR pose p; VAR bool ok; VAR string s;
        s:=ReadStr(f);
        ok:=StrToVal(s,p);
        TPWrite ValToStr(ok)+" "+ValToStr(p.trans.y);
    ENDPROC
ENDMODULE
